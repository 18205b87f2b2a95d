"""Which rules a study is judged by, and that it says so."""

import json
import subprocess
from pathlib import Path

import pytest

from ship_trl.study import rules
from ship_trl.study.manifest import write_plan
from ship_trl.study.plan import plan_jobs, to_study
from ship_trl.study.study import read_study


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository with a plan in one commit."""
    for name, text in ((rules.PLAN_TEXT, "rules"), (f"conf/{rules.NUMBERS}", "margin: 0.2")):
        path = tmp_path / "repository" / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    folder = tmp_path / "repository"
    who = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    for line in (("init", "-q"), ("add", "."), (*who, "commit", "-q", "-m", "Plan")):
        subprocess.run(["git", "-C", str(folder), *line], check=True)
    monkeypatch.setattr(rules, "conf_dir", lambda: folder / "conf")
    return folder


def test_the_commit_and_time_of_the_plan_are_named(checkout: Path) -> None:
    line = ["git", "-C", str(checkout), "log", "-1", "--format=%H of %cI"]
    wanted = subprocess.run(line, capture_output=True, text=True, check=True).stdout.strip()
    found = rules.stamp()
    assert found["commit"] == wanted and wanted in rules.describe_rules(found)
    assert "changed since" not in rules.describe_rules(found)


def test_a_plan_that_was_changed_has_no_commit_and_is_said_to_be_changed(checkout: Path) -> None:
    before = rules.stamp()
    (checkout / rules.PLAN_TEXT).write_text("other rules")
    assert rules.stamp()["commit"] is None and "no commit" in rules.describe_rules(rules.stamp())
    assert "changed since" in rules.describe_rules(before)


def test_without_a_repository_or_a_plan_nothing_is_claimed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rules, "conf_dir", lambda: tmp_path / "conf")
    assert rules.stamp() | {"begun": ""} == {"digest": None, "commit": None, "begun": ""}
    assert "nothing shows that the rules are older" in rules.describe_rules({})


def test_a_study_keeps_the_rules_and_the_seeds_that_it_was_begun_with(tmp_path: Path) -> None:
    def begin(seeds: int) -> None:
        config = to_study(["profile=smoke", f"seeds={seeds}", f"output={tmp_path}"])
        write_plan(plan_jobs(config), config)

    begin(3)
    first = read_study(tmp_path)
    begin(5)
    later, jobs = read_study(tmp_path), json.loads((tmp_path / "study.json").read_text())["jobs"]
    assert first.plan.seeds == later.plan.seeds == (0, 1, 2)
    assert {job["seed"] for job in jobs} == set(range(5))
    begun = first.plan.rules
    assert begun == later.plan.rules and begun["begun"] in rules.describe_rules(begun)
