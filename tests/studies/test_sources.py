"""The study of sources: which runs it plans, that it goes on, how measures are judged, and its page."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from studies.lockstep import KEY, Task
from studies.sources import __main__ as command
from studies.sources import plan, report
from studies.sources.plan import SETTINGS
from studies.sources.runs import train
from tests.command import ROOT

KEPT = ROOT / "outputs/sources"
PAGE = ROOT / "studies/sources/README.md"


def test_every_case_is_source_and_target_of_every_other() -> None:
    for setting in SETTINGS.values():
        tasks = plan.plan_tasks(setting)
        count = len(setting.cases)
        assert len({task.key for task in tasks}) == len(tasks)
        transfers = [task for task in tasks if task.source]
        assert len(transfers) == count * (count - 1) * len(setting.arms) * setting.seeds
        assert {(task.target, task.seed) for task in tasks if task.is_source} == {
            (case, seed) for case in setting.cases for seed in range(setting.seeds)
        }


@pytest.mark.long
@pytest.mark.parametrize(("name", "lengths"), [("numbers", (480, 480)), ("pixels", (2060, 30))])
def test_a_transfer_begins_as_its_source_ended(name: str, lengths: tuple[int, int], tmp_path: Path) -> None:
    overrides = SETTINGS[name].overrides
    (first,) = train([Task("1", "", "scratch", 9001, lengths[0], is_source=True)], overrides, tmp_path)
    kinds = ("1", "FTW"), ("1", "FE2"), ("", "scratch")
    tasks = [Task("2", source, arm, 9001, lengths[1]) for source, arm in kinds]
    whole, frozen, scratch = train(tasks, overrides, tmp_path)
    for row in (whole, frozen, scratch):
        assert len(row["greedy"].split()) == len(row["reached"]) == 16
        assert row["best_known"] > row["random"]
    assert len(whole["source_greedy"].split()) == 6 and not scratch["source_greedy"]
    # The whole network of the source's best evaluation.
    best = max(float(word) for word in first["greedy"].split())
    assert float(whole["source_greedy"].split()[0]) == pytest.approx(best, abs=0.02)
    assert whole["greedy"].split()[0] != scratch["greedy"].split()[0]


def test_runs_of_the_table_are_not_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setting = replace(SETTINGS["numbers"], cases=("1", "2"), arms=("FTW",), seeds=2, scratch_seeds=2)
    monkeypatch.setattr(command, "FOLDER", tmp_path)
    monkeypatch.setitem(SETTINGS, "numbers", setting)
    table = tmp_path / "numbers.csv"
    pd.DataFrame(plan.plan_tasks(setting))[[*KEY]].to_csv(table, index=False)
    before = table.read_bytes()
    command.main(["run", "numbers"])
    assert table.read_bytes() == before


@pytest.mark.parametrize(("setting", "after"), [("numbers", "the winner is"), ("pixels", "no arm is judged")])
def test_the_page_follows_from_the_kept_runs(
    setting: str,
    after: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    for name in (f"{setting}.csv.xz", f"{setting}_measures.csv"):
        shutil.copy(KEPT / name, tmp_path / name)
    command.main(["report", setting, "--markdown"])
    printed = capsys.readouterr().out
    kept = re.search(rf"<!-- begin: {setting} -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None and kept[1].strip() == printed[: printed.index(after)].strip()
    judged = tmp_path / f"{setting}_judgements.csv"
    assert judged.exists() == (setting == "numbers")
    if judged.exists():
        assert judged.read_bytes() == (KEPT / judged.name).read_bytes()
