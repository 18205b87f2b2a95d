"""Which rules a study is judged by, and that it says so."""

import hashlib
import json
import subprocess
from pathlib import Path

import pytest

from ship_trl.study.manifest import describe_rules, stamp, write_plan
from ship_trl.study.plan import plan_jobs, to_study
from ship_trl.study.study import read_study


@pytest.fixture
def plan(tmp_path: Path) -> tuple[Path, Path]:
    """A plan's text and numbers, in one commit."""
    folder = tmp_path / "repository"
    folder.mkdir()
    files = folder / "plan.md", folder / "numbers.yaml"
    for path in files:
        path.write_text(path.name)
    who = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    for line in (("init", "-q"), ("add", "."), (*who, "commit", "-q", "-m", "Plan")):
        subprocess.run(["git", "-C", str(folder), *line], check=True)
    return files


def test_the_commit_and_time_of_the_plan_are_named(plan: tuple[Path, Path]) -> None:
    line = ["git", "-C", str(plan[0].parent), "log", "-1", "--format=%H of %cI"]
    wanted = subprocess.run(line, capture_output=True, text=True, check=True).stdout.strip()
    found = stamp(plan)
    assert found["commit"] == wanted and wanted in describe_rules(found, plan)
    assert found["digest"] == hashlib.sha256(b"plan.mdnumbers.yaml").hexdigest()
    assert "changed since" not in describe_rules(found, plan)
    plan[0].write_text("other rules")
    assert stamp(plan)["commit"] is None and "no commit" in describe_rules(stamp(plan), plan)
    assert "changed since" in describe_rules(found, plan)


def test_without_a_repository_or_a_plan_nothing_is_claimed(tmp_path: Path) -> None:
    assert stamp(()) == {}
    missing = (tmp_path / "plan.md",)
    assert stamp(missing) | {"begun": ""} == {"digest": None, "commit": None, "begun": ""}
    assert "nothing shows that the rules are older" in describe_rules({}, missing)


def test_a_study_keeps_the_rules_and_the_seeds_that_it_was_begun_with(
    plan: tuple[Path, Path], tmp_path: Path
) -> None:
    def begin(seeds: int) -> None:
        config = to_study(["profile=smoke", f"seeds={seeds}", f"output={tmp_path}"])
        write_plan(plan_jobs(config), config, plan)

    begin(3)
    first = read_study(tmp_path)
    begin(5)
    later, jobs = read_study(tmp_path), json.loads((tmp_path / "study.json").read_text())["jobs"]
    assert first.plan.seeds == later.plan.seeds == (0, 1, 2)
    assert {job["seed"] for job in jobs} == set(range(5))
    begun = first.plan.rules
    assert begun == later.plan.rules and begun["begun"] in describe_rules(begun, plan)
