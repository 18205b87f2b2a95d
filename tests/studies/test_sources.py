"""The study of sources: which runs it plans, that it goes on, how measures are judged, and its page."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ship_trl.cli.cases import ZERO_SHOT_ARM, ZERO_SHOT_GAIN
from studies.runs import Row, Setting, Task, join
from studies.sources import __main__ as command
from studies.sources import plan, report
from studies.sources.judge import winner
from studies.sources.measures import MEASURES
from studies.sources.plan import SETTINGS
from studies.sources.runs import train
from tests.command import ROOT

KEPT = ROOT / "outputs/sources"
PAGE = ROOT / "studies/sources/README.md"
CASES = ("1", "2", "3", "4", "5", "6")


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Setting:
    setting = replace(
        SETTINGS["numbers"],
        cases=CASES,
        arms=("FTW", "FTH"),
        seeds=2,
        scratch_seeds=2,
    )
    for module in (command, report):
        monkeypatch.setattr(module, "FOLDER", tmp_path)
    monkeypatch.setitem(SETTINGS, "numbers", setting)
    return setting


def row(task: Task, setting: Setting, score: float) -> Row:
    """Return a run in which all evaluations but the first have a score."""
    return (
        {name: getattr(task, name) for name in ("target", "source", "arm", "seed")}
        | {"length": task.length(setting), "random": -100, "best_known": 100}
        | {"greedy": join([-100.0] + [200 * score - 100] * 15), "reached": "0" + "1" * 15}
        | {"source_greedy": "-100.00 0.00" if task.source else "", "seconds": 1.0}
    )


def write(path: Path, rows: list[Row]) -> None:
    pd.DataFrame(rows).to_csv(path, index=False)


def test_every_case_is_source_and_target_of_every_other() -> None:
    for setting in SETTINGS.values():
        tasks = plan.plan_tasks(setting)
        count = len(setting.cases)
        assert len({task.key(setting) for task in tasks}) == len(tasks)
        transfers = [task for task in tasks if task.source]
        assert len(transfers) == count * (count - 1) * len(setting.arms) * setting.seeds
        assert {(task.target, task.seed) for task in tasks if task.is_source} == {
            (case, seed) for case in setting.cases for seed in range(setting.seeds)
        }


@pytest.mark.parametrize(
    ("name", "lengths"), [("numbers", (480, 480)), pytest.param("pixels", (2060, 30), marks=pytest.mark.long)]
)
def test_a_transfer_begins_as_its_source_ended(name: str, lengths: tuple[int, int], tmp_path: Path) -> None:
    setting = replace(SETTINGS[name], source_length=lengths[0], target_length=lengths[1])
    (first,) = train([Task("1", "", "scratch", 9001, is_source=True)], setting, tmp_path)
    tasks = [Task("2", "1", "FTW", 9001), Task("2", "1", "FE2", 9001), Task("2", "", "scratch", 9001)]
    whole, frozen, scratch = train(tasks, setting, tmp_path)
    for row in (whole, frozen, scratch):
        assert len(row["greedy"].split()) == len(row["reached"]) == 16
        assert row["best_known"] > row["random"]
    assert len(whole["source_greedy"].split()) == 6 and not scratch["source_greedy"]
    # The whole network of the source's best evaluation.
    best = max(float(word) for word in first["greedy"].split())
    assert float(whole["source_greedy"].split()[0]) == pytest.approx(best, abs=0.02)
    assert whole["greedy"].split()[0] != scratch["greedy"].split()[0]


def test_runs_of_the_table_are_not_made_again(tiny: Setting, tmp_path: Path) -> None:
    table = tmp_path / "numbers.csv"
    write(table, [row(task, tiny, 0.5) for task in plan.plan_tasks(tiny)])
    before = table.read_bytes()
    command.main(["run", "numbers"])
    assert table.read_bytes() == before


def test_the_measure_that_the_gains_follow_wins(
    tiny: Setting, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    generator = np.random.default_rng(9001)
    rows, measures = [], []
    place = {case: number for number, case in enumerate(CASES)}
    for task in plan.plan_tasks(tiny):
        # Gains fall with the distance of two cases' places, and FTW gains more.
        apart = abs(place[task.target] - place[task.source]) if task.source else 0
        gain = (0.3 - 0.04 * apart + 0.1 * (task.arm == "FTW")) if task.source else 0.0
        rows.append(row(task, tiny, 0.4 + gain + 0.01 * generator.normal()))
    write(tmp_path / "numbers.csv", rows)
    for seed in range(tiny.seeds):
        for target in CASES:
            for source in (case for case in CASES if case != target):
                values: dict[str, object] = {"target": target, "source": source, "seed": seed}
                for name in MEASURES:
                    values[name] = generator.normal()
                    values[f"{name} seconds"] = 0.1
                # An oracle is perfect, and cannot win; a larger distance is less similar.
                values["cka"] = -abs(place[target] - place[source])
                values["distance"] = abs(place[target] - place[source]) + 0.3 * generator.normal()
                measures.append(values)
    write(tmp_path / "numbers_measures.csv", measures)
    command.main(["report", "numbers"])
    printed = capsys.readouterr().out
    assert "the winner is distance" in printed
    table = pd.read_csv(tmp_path / "numbers_judgements.csv")
    best = winner(table)
    assert (best["measure"], best["arm"]) == ("distance", "FTW")
    assert 0.3 < best["gain_low"] < best["gain"] < 0.45
    assert {*table["measure"]} == {*MEASURES, "elsewhere", "regression"}
    assert (tmp_path / "numbers.png").stat().st_size > 10_000


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


def test_cases_recommends_by_the_measure_that_won() -> None:
    best = winner(pd.read_csv(KEPT / "numbers_judgements.csv"))
    assert (best["measure"], best["arm"]) == ("zero_shot", ZERO_SHOT_ARM)
    assert (best["gain"], best["gain_low"], best["gain_high"]) == ZERO_SHOT_GAIN
