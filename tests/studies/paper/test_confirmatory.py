"""The confirmatory study's kept tables: whole seeds, by the plan; and what follows from them."""

import csv
import hashlib
import math
import re
import subprocess
from collections import defaultdict
from datetime import datetime
from pathlib import Path

import pytest

from ship_trl.study.manifest import load_plan
from ship_trl.study.report import write
from ship_trl.study.tables import LAYERS, read_layers, read_tables
from studies.paper.claims import claims
from tests.command import ROOT, ship_trl

FOLDER = ROOT / "outputs/confirmatory"
REPORT = FOLDER / "report"
# Seeds of the last look; those of the next one are kept as they come in, and not looked at.
SEEN = 15


def read(path: Path) -> list[list[str]]:
    with path.open(newline="") as file:
        return list(csv.reader(file))


def same(one: str, other: str) -> bool:
    """Whether two cells say the same; processors differ in the last digits of a number."""
    try:
        return math.isclose(float(one), float(other), rel_tol=1e-6, abs_tol=1e-9) or one == other
    except ValueError:
        return one == other


def test_its_seeds_are_whole_and_of_the_plan() -> None:
    plan, runs = read_tables(FOLDER)
    planned, kept = defaultdict(set), defaultdict(set)
    for job in plan.jobs:
        planned[job.seed].add((job.part, job.label, job.arm))
    for record in runs:
        kept[record.seed].add(record.place)
        assert record.profile == "quick" and record.episodes == 600
    assert sorted(planned) == list(range(100, 115))
    # Seeds are run one after another.
    assert list(kept) == sorted(planned)[: len(kept)]
    assert all(kept[seed] == planned[seed] for seed in kept)
    assert {*read_layers(FOLDER / LAYERS)["seed"]} <= kept.keys()


def test_it_is_judged_by_the_rules_that_it_was_begun_with() -> None:
    """The commit that the study names has the plan as registered; the page keeps its rules word for word."""
    plan = load_plan(FOLDER)
    assert plan.seeds == tuple(range(100, 115))
    commit, _, committed = plan.rules["commit"].partition(" of ")
    assert datetime.fromisoformat(committed) < datetime.fromisoformat(plan.rules["begun"])
    text, numbers = (path.read_bytes() for path in claims().rules)
    shown = subprocess.run(["git", "show", f"{commit}:docs/analysis-plan.md"], cwd=ROOT, capture_output=True)
    if shown.returncode:
        pytest.skip("no git history")
    assert hashlib.sha256(shown.stdout + numbers).hexdigest() == plan.rules["digest"]
    registered, page = shown.stdout.decode(), text.decode()
    for heading in ("What is measured of a run", "The claims"):
        (section,) = re.findall(rf"## {heading}\n.*?(?=\n## )", registered, re.DOTALL)
        assert section in page, heading
    judged = registered.partition("## From runs to a verdict\n")[2].partition("\n## ")[0]
    # What measured the gains was a command; all else decides.
    rest = re.sub(r" The gains are measured by\n.*?(?=6\. \*\*Looks)", "\n", judged, flags=re.DOTALL)
    assert all(line in page for line in rest.splitlines())


@pytest.mark.long
def test_the_report_that_is_kept_follows_from_the_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = tmp_path / "made"
    # Pictures take most of the time.
    monkeypatch.setattr(write, "draw_all", lambda *_: [])
    write.report(FOLDER, made, SEEN)
    names = {path.name for path in made.glob("*.csv")}
    assert {path.name for path in REPORT.glob("*.csv")} == names
    for name in sorted(names):
        kept, anew = read(REPORT / name), read(made / name)
        assert len(kept) == len(anew) and kept[0] == anew[0]
        for here, there in zip(kept, anew, strict=True):
            assert all(map(same, here, there)), (name, here, there)


@pytest.mark.long
def test_the_pictures_that_are_kept_follow_from_the_tables(tmp_path: Path) -> None:
    made = tmp_path / "made"
    words = str(FOLDER), "--seeds", str(SEEN), "--output", str(made)
    ship_trl(*words, folder=tmp_path, verb="study report", new_process=True)
    kept = {path.name for path in REPORT.glob("*.png")}
    assert kept and kept <= {path.name for path in made.glob("*.png")}
