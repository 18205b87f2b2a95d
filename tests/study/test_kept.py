"""The quick study that is kept with the project: what the README says of it is what its report says."""

import csv
import re
from pathlib import Path

import pytest

from ship_trl.study.answers import ALL
from ship_trl.study.claims import Hypothesis
from ship_trl.study.config import to_study
from ship_trl.study.plan import SOURCES, plan_jobs
from tests.test_cli import ROOT

REPORT = ROOT / "outputs/quick_study/report"
README = (ROOT / "README.md").read_text()


def rows(name: str) -> list[dict[str, str]]:
    with (REPORT / name).open(newline="") as file:
        return list(csv.DictReader(file))


# What has joined the plan since it was run.
LATER = re.compile("FE.-permuted|FE[124]-random|ship|self[46]|[46]-new")


def test_every_planned_run_is_in_it() -> None:
    planned = {
        (j.part, j.label, j.arm, str(j.seed))
        for j in plan_jobs(to_study(["profile=quick"]))
        if not (LATER.fullmatch(j.arm) or LATER.fullmatch(j.label) or (j.label, j.arm) == ("self", "FTW"))
    }
    assert {(r["part"], r["pair"], r["arm"], r["seed"]) for r in rows("runs.csv")} == planned
    arms = {(part, label, arm) for part, label, arm, _ in planned}
    assert {(r["part"], r["pair"], r["arm"]) for r in rows("arms.csv")} == arms
    assert {part for part, _, _ in arms} > {SOURCES}


def test_the_readme_has_its_verdicts_and_figures() -> None:
    assert (REPORT / "verdicts.md").read_text() in README
    pictures = re.findall(r"\]\((outputs/quick_study/report/[a-z_]+\.png)\)", README)
    assert {Path(path).stem for path in pictures} == {
        "pair_high",
        "pair_low",
        "pair_lowest",
        "reuse",
        "gains",
    }
    assert all((ROOT / path).stat().st_size > 20_000 for path in pictures)


@pytest.mark.parametrize("hypothesis", ALL, ids=lambda h: h.name)
def test_each_claim_stands_on_its_contrasts(hypothesis: Hypothesis) -> None:
    found = [row for row in rows("claims.csv") if row["claim"] == hypothesis.name]
    assert len(found) == len(hypothesis.tests) and {row["seeds"] for row in found} == {"5"}
    assert {row["sentence"] for row in found} == {hypothesis.sentence}
