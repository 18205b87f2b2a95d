"""The second study: which runs it plans, how last networks are tested, and what contrasts say."""

import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from studies.runs import Task, add_outcomes, join
from studies.second import report
from studies.second.__main__ import main
from studies.second.answers import (
    Contrast,
    answers,
    compare,
    group_runs,
    judge,
    learner_label,
)
from studies.second.plan import FIRST_SOURCE, LEARNERS, SETTINGS, SIZES, TRAFFIC, Sizes, plan_tasks, transfers
from studies.second.runs import STARTS, train


def test_sources_have_seeds_of_their_own_and_are_trained_first() -> None:
    for name, sizes in SIZES.items():
        tasks = plan_tasks(sizes)
        assert len({task.key(SETTINGS[name]) for task in tasks}) == len(tasks)
        sources = {(task.target, task.seed) for task in tasks if task.is_source}
        needed = {(task.source, task.source_seed) for task in tasks if task.source}
        learned = {one for one in needed if one[0] != TRAFFIC}
        assert learned <= sources
        assert not {task.seed for task in tasks if not task.is_source} & {seed for _, seed in sources}
        order = [task.is_source for task in tasks]
        assert order == sorted(order, reverse=True)
    shared = transfers("imazu01", TRAFFIC, ("FTW",), 20, 5)
    assert set(Counter(task.source_seed for task in shared).values()) == {4}


def test_last_networks_are_tested_on_scenes_that_they_did_not_see(tmp_path: Path) -> None:
    setting = replace(SETTINGS["numbers"], source_length=480, target_length=480)
    seed = FIRST_SOURCE
    (source,) = train([Task("3", "", "scratch", seed, True)], setting, tmp_path)
    shutil.copy(tmp_path / f"3-{seed}.safetensors", tmp_path / f"traffic-{seed}.safetensors")
    tasks = [
        *transfers("4", "3", ("FTW", "FE3-random"), 1),
        *transfers("imazu05", TRAFFIC, ("FTH",), 1, 5),
        Task("2", "", "scratch", 9001),
    ]
    rows = train(tasks, setting, tmp_path)
    assert source["traffic"] == 0.0
    assert [row["arm"] for row in rows] == ["FTW", "FE3-random", "FTH", "scratch"]
    for row in rows:
        for name, count in (("perturbed", STARTS), ("replayed", STARTS), ("traffic", 500)):
            assert 0 <= row[name] <= 1 and row[name] * count == pytest.approx(round(row[name] * count))


def test_a_contrast_says_what_its_samples_say() -> None:
    generator = np.random.default_rng(9001)
    base = 0.5 + 0.1 * generator.normal(size=45)
    found = judge(
        [
            compare(1, "", "more", base[:30] + 0.3, base, 0.5),
            compare(1, "", "less", base[:30] - 0.3, base, 0.5),
            compare(1, "", "equal", 0.5 + 0.001 * generator.normal(size=30), base, 0.5),
            compare(1, "", "open", base[:4] + 0.15 * generator.normal(size=4), base, 0.5),
        ]
    )
    assert [one.verdict for one in found] == [one.what for one in found]
    assert found[0].low < 0.3 < found[0].high and found[0].value == pytest.approx(0.3, abs=0.05)


def test_paired_differences_that_are_all_alike_decide_and_many_contrasts_are_adjusted() -> None:
    assert judge([compare(4, "", "", np.full(5, 0.2))])[0].verdict == "more"
    assert judge([compare(4, "", "", np.zeros(5))])[0].verdict == "open"
    alone = Contrast(1, "", "", 0.1, 0.0, 0.2, 1.0, 0.02, 1.0, "")
    assert judge([alone])[0].verdict == "more"
    assert {one.verdict for one in judge([alone] * 4)} == {"open"}


Area = Callable[[Task], float]


def made_runs(area: Area, setting: str = "numbers", sizes: Sizes | None = None) -> pd.DataFrame:
    """Return all runs of a small study; `area` says what each reaches."""
    generator, rows = np.random.default_rng(9001), []
    for task in plan_tasks(sizes or replace(SIZES["numbers"], scratch=8, arm=8, problem=2, tuned=8)):
        reached = area(task) + 0.02 * generator.normal()
        rows.append(
            {name: getattr(task, name) for name in ("target", "source", "arm", "seed", "learner")}
            | {"length": task.length(SETTINGS[setting]), "random": -100, "best_known": 100}
            | {"greedy": join([-100.0] + [200 * reached - 100] * 15), "reached": "0" + "1" * 15}
            | {"source_greedy": "", "perturbed": reached, "replayed": 0.3, "traffic": 0.5}
        )
    return pd.DataFrame(rows)


def some_gain(task: Task) -> float:
    """Return 0.4, and more for FTW, for FE4 of the target itself, and for a quick learner on even seeds."""
    area = 0.4 + {"FTW": 0.3}.get(task.arm, 0.0)
    if task.arm == "FE4" and task.source == task.target:
        area += 0.2
    if task.learner == LEARNERS[0]:
        area += 0.2 if task.seed % 2 == 0 else -0.2
    return area


def judged(runs: pd.DataFrame) -> list[Contrast]:
    add_outcomes(runs)
    return answers(group_runs(runs))


def test_every_question_is_answered_by_its_runs() -> None:
    found = judged(made_runs(some_gain))
    assert Counter(one.question for one in found) == {1: 21, 2: 3, 3: 3, 4: 12, 6: 6}
    says = {(one.question, one.where, one.what): one.verdict for one in found}
    for pair in ("high", "low", "lowest"):
        assert says[1, pair, "FTW less scratch"] == says[1, pair, "FTW less FT4"] == "more"
        assert says[1, pair, "FE3 less scratch"] == "equal"
    assert says[3, "imazu", "FTW less scratch"] == "more"
    # FE4 of another case ends lower than that of the target.
    assert {one.verdict for one in found if one.question == 2} == {"less"}
    # 0.4 and 0.7 from drawn starts, and 0.3 by a replay.
    assert {one.verdict for one in found if one.question == 4} == {"more"}
    # The learner that is best on even seeds is bad on odd ones.
    tuned = {one.what.split()[0]: one for one in found if one.question == 6}
    assert all(learner_label(LEARNERS[0]) in one.what for one in tuned.values())
    assert tuned["FTW"].value == pytest.approx(0.3, abs=0.05)
    assert 1 - tuned["FTW"].possible_gain == pytest.approx(0.2, abs=0.05)


def test_a_table_that_is_not_whole_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    small = replace(SIZES["numbers"], scratch=4, arm=4, problem=2, tuned=4)
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    monkeypatch.setitem(SIZES, "numbers", small)
    runs = made_runs(some_gain, sizes=small)
    last = len(runs) - 1
    wrong = {
        "3 runs are missing": runs[:-3],
        "has a run twice": pd.concat([runs, runs[-1:]]),
        "has a share that is not from 0 to 1": runs.assign(perturbed=2.0),
        "a run has wrong numbers": runs.replace({"greedy": {runs["greedy"][last]: "nan " * 16}}),
        "no column 'perturbed'": runs.drop(columns="perturbed"),
        "numbers.csv is not a table of runs": runs[["target", "source"]],
    }
    for message, made in wrong.items():
        made.to_csv(tmp_path / "numbers.csv", index=False)
        with pytest.raises(SystemExit) as error:
            main(["report", "numbers"])
        assert error.value.code == 1 and message in capsys.readouterr().err
