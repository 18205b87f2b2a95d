"""The second study: which runs it plans, how last networks are tested, and what contrasts say."""

import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ship_trl.study.statistics import Sample
from studies.lockstep import KEY, Task, add_outcomes, join
from studies.second import report
from studies.second.__main__ import main
from studies.second.answers import answers, contrast, group_runs, judge, learner_label
from studies.second.plan import FIRST_SOURCE, LEARNERS, SETTINGS, SIZES, TRAFFIC, Sizes, plan_tasks
from studies.second.runs import STARTS, train


def test_sources_have_seeds_of_their_own_and_are_trained_first() -> None:
    for name in SIZES:
        tasks = plan_tasks(name)
        assert len({task.key for task in tasks}) == len(tasks)
        sources = {(task.target, task.seed) for task in tasks if task.is_source}
        needed = {(task.source, task.source_seed) for task in tasks if task.source}
        learned = {one for one in needed if one[0] != TRAFFIC}
        assert learned <= sources
        assert not {task.seed for task in tasks if not task.is_source} & {seed for _, seed in sources}
        order = [task.is_source for task in tasks]
        assert order == sorted(order, reverse=True)
    shared = [task for task in plan_tasks("numbers") if (task.target, task.source) == ("imazu01", TRAFFIC)]
    assert set(Counter((task.arm, task.source_seed) for task in shared).values()) == {4}


@pytest.mark.long
def test_last_networks_are_tested_on_scenes_that_they_did_not_see(tmp_path: Path) -> None:
    overrides, seed, length = SETTINGS["numbers"].overrides, FIRST_SOURCE, 480
    (source,) = train([Task("3", "", "scratch", seed, length, is_source=True)], overrides, tmp_path)
    shutil.copy(tmp_path / f"3-{seed}.safetensors", tmp_path / f"traffic-{seed}.safetensors")
    tasks = [
        Task(target, origin, arm, 1000, length, source_seed=seed)
        for target, origin, arm in (("4", "3", "FTW"), ("4", "3", "FE3-random"), ("imazu05", TRAFFIC, "FTH"))
    ]
    rows = train([*tasks, Task("2", "", "scratch", 9001, length)], overrides, tmp_path)
    assert source["traffic"] == 0.0
    assert [row["arm"] for row in rows] == ["FTW", "FE3-random", "FTH", "scratch"]
    for row in rows:
        for name, count in (("perturbed", STARTS), ("replayed", STARTS), ("traffic", 500)):
            assert 0 <= row[name] <= 1 and row[name] * count == pytest.approx(round(row[name] * count))


def judged(question: int, *samples: tuple[Sample, Sample | None]) -> list[str]:
    found = judge(pd.DataFrame([contrast(question, "", "", *pair, 0.5) for pair in samples]))
    return found["verdict"].to_list()


def test_a_contrast_says_what_its_samples_say() -> None:
    generator = np.random.default_rng(9001)
    base = 0.5 + 0.1 * generator.normal(size=45)
    equal, few = 0.5 + 0.001 * generator.normal(size=30), base[:4] + 0.15 * generator.normal(size=4)
    samples = base[:30] + 0.3, base[:30] - 0.3, equal, few
    assert judged(1, *((one, base) for one in samples)) == ["more", "less", "equal", "open"]
    found = contrast(1, "", "", samples[0], base)
    assert found["low"] < 0.3 < found["high"] and found["value"] == pytest.approx(0.3, abs=0.05)


def test_paired_differences_that_are_all_alike_decide_and_many_contrasts_are_adjusted() -> None:
    assert judged(4, (np.full(5, 0.2), None)) == ["more"]
    assert judged(4, (np.zeros(5), None)) == ["open"]
    # Its p is 0.01.
    alone = np.array([0.05, 0.1, 0.1, 0.15, 0.2, -0.02, 0.1]), None
    assert judged(4, alone) == ["more"] and set(judged(4, *[alone] * 8)) == {"open"}


Area = Callable[[Task], float]


def made_runs(area: Area) -> pd.DataFrame:
    """Return all runs of a study from numbers; `area` says what each reaches."""
    generator, rows = np.random.default_rng(9001), []
    for task in plan_tasks("numbers"):
        reached = area(task) + 0.02 * generator.normal()
        rows.append(
            dict(zip(KEY, task, strict=False))
            | {"random": -100, "best_known": 100}
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


def test_every_question_is_answered_by_its_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SIZES, "numbers", Sizes(scratch=8, arm=8, problem=2, tuned=8))
    runs = made_runs(some_gain)
    add_outcomes(runs)
    found = answers(group_runs(runs)).set_index(["question", "where", "what"])
    assert found.groupby("question").size().to_dict() == {1: 21, 2: 3, 3: 3, 4: 12, 6: 6}
    says = found["verdict"]
    for pair in ("high", "low", "lowest"):
        assert says[1, pair, "FTW less scratch"] == says[1, pair, "FTW less FT4"] == "more"
        assert says[1, pair, "FE3 less scratch"] == "equal"
    assert says[3, "imazu", "FTW less scratch"] == "more"
    # FE4 of another case ends lower than that of the target.
    assert {*says[2]} == {"less"}
    # 0.4 and 0.7 from drawn starts, and 0.3 by a replay.
    assert {*says[4]} == {"more"}
    # The learner that is best on even seeds is bad on odd ones.
    tuned = {what.split()[0]: one for (_, what), one in found.loc[6].iterrows()}
    assert found.loc[6].index.get_level_values("what").str.contains(learner_label(LEARNERS[0])).all()
    assert tuned["FTW"]["value"] == pytest.approx(0.3, abs=0.05)
    assert 1 - tuned["FTW"]["possible_gain"] == pytest.approx(0.2, abs=0.05)


def test_a_table_that_is_not_whole_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    monkeypatch.setitem(SIZES, "numbers", Sizes(scratch=4, arm=4, problem=2, tuned=4))
    runs = made_runs(some_gain)
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
