"""The second study: which runs it plans, how last networks are tested, and what contrasts say."""

import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import answers, questions
from benchmarks.question_runs import STARTS, drawn_starts, train
from benchmarks.questions import (
    FIRST_SOURCE,
    LEARNERS,
    SETTINGS,
    SIZES,
    Sizes,
    StudyRow,
    plan_tasks,
    transfers,
)
from benchmarks.runs import Task, join
from benchmarks.verdicts import Contrast, Verdict, judge, learner_label, paired, read_study_runs, unpaired
from benchmarks.verdicts import answers as judge_all
from ship_trl.config.errors import ConfigError
from ship_trl.study.report.tables import write_csv


def test_sources_have_seeds_of_their_own_and_are_trained_first() -> None:
    for name, sizes in SIZES.items():
        tasks = plan_tasks(sizes)
        assert len({task.key(SETTINGS[name]) for task in tasks}) == len(tasks)
        sources = {(task.target, task.seed) for task in tasks if task.is_source}
        needed = {(task.source, task.source_seed) for task in tasks if task.source}
        learned = {one for one in needed if one[0] != questions.TRAFFIC}
        assert learned <= sources
        assert not {task.seed for task in tasks if not task.is_source} & {seed for _, seed in sources}
        order = [task.is_source for task in tasks]
        assert order == sorted(order, reverse=True)


def test_sources_of_traffic_are_shared_evenly() -> None:
    tasks = transfers("imazu01", questions.TRAFFIC, ("FTW",), 20, questions.TRAFFIC_SEEDS)
    assert set(Counter(task.source_seed for task in tasks).values()) == {4}
    assert [task.source_seed for task in transfers("2", "1", ("FTW",), 3)] == [2000, 2001, 2002]


def test_last_networks_are_tested_on_scenes_that_they_did_not_see(tmp_path: Path) -> None:
    setting = replace(SETTINGS["numbers"], source_length=960, target_length=960)
    seed = FIRST_SOURCE
    (source,) = train([Task("3", "", "scratch", seed, True)], setting, tmp_path)
    shutil.copy(tmp_path / f"3-{seed}.safetensors", tmp_path / f"traffic-{seed}.safetensors")
    tasks = [
        *transfers("4", "3", ("FTW", "FE3-random"), 1),
        *transfers("imazu05", questions.TRAFFIC, ("FTH",), 1, 5),
        Task("2", "", "scratch", 9001),
    ]
    rows = train(tasks, setting, tmp_path)
    assert isinstance(source, StudyRow) and source.traffic == 0.0
    assert [row.arm for row in rows] == ["FTW", "FE3-random", "FTH", "scratch"]
    for row in rows:
        assert isinstance(row, StudyRow)
        for share in (row.perturbed, row.replayed):
            assert 0 <= share <= 1 and share * STARTS == pytest.approx(round(share * STARTS))
        assert 0 <= row.traffic <= 1 and row.traffic * 500 == pytest.approx(round(row.traffic * 500))


def test_a_run_of_random_encounters_that_fails_is_named(tmp_path: Path) -> None:
    setting = replace(SETTINGS["numbers"], overrides=("observation=sonar",))
    with pytest.raises(ConfigError, match="the run from traffic with seed 2000 failed"):
        questions.learn_traffic(setting, tmp_path)
    assert not list(tmp_path.rglob("*.safetensors"))


def test_drawn_starts_differ_by_the_bounds_of_the_suite() -> None:
    for target, bound in (("4", 20.0), ("imazu05", 5.0)):
        spread = np.ptp(drawn_starts(target, STARTS)[:, 0].numpy())
        assert bound < spread <= 2 * bound


def test_a_contrast_says_what_its_samples_say() -> None:
    generator = np.random.default_rng(9001)
    base = 0.5 + 0.1 * generator.normal(size=45)
    found = judge(
        [
            unpaired(1, "", "more", base[:30] + 0.3, base, 0.5),
            unpaired(1, "", "less", base[:30] - 0.3, base, 0.5),
            unpaired(1, "", "equal", 0.5 + 0.001 * generator.normal(size=30), base, 0.5),
            unpaired(1, "", "open", base[:4] + 0.15 * generator.normal(size=4), base, 0.5),
        ]
    )
    assert [one.verdict.value for one in found] == [one.what for one in found]
    assert found[0].low < 0.3 < found[0].high and found[0].value == pytest.approx(0.3, abs=0.05)


def test_paired_differences_that_are_all_alike_decide() -> None:
    assert judge([paired(4, "", "", np.full(5, 0.2))])[0].verdict is Verdict.more
    assert judge([paired(4, "", "", np.zeros(5))])[0].verdict is Verdict.open


Area = Callable[[Task], float]


def made_rows(area: Area, setting: str = "numbers", sizes: Sizes | None = None) -> list[dict[str, object]]:
    """Return all runs of a small study; `area` says what each reaches."""
    generator, rows = np.random.default_rng(9001), []
    for task in plan_tasks(sizes or replace(SIZES["numbers"], scratch=8, arm=8, problem=2, tuned=8)):
        reached = area(task) + 0.02 * generator.normal()
        made = StudyRow(
            **{name: getattr(task, name) for name in ("target", "source", "arm", "seed", "learner")},
            length=task.length(SETTINGS[setting]),
            random=-100,
            best_known=100,
            greedy=join([-100.0] + [200 * reached - 100] * 15),
            reached="0" + "1" * 15,
            source_greedy="",
            seconds=1.0,
            perturbed=reached,
            replayed=0.3,
            traffic=0.5,
        )
        rows.append(asdict(made))
    return rows


def some_gain(task: Task) -> float:
    """Return 0.4, and more for FTW, for FE4 of the target itself, and for a quick learner on even seeds."""
    area = 0.4 + {"FTW": 0.3}.get(task.arm, 0.0)
    if task.arm == "FE4" and task.source == task.target:
        area += 0.2
    if task.learner == LEARNERS[0]:
        area += 0.2 if task.seed % 2 == 0 else -0.2
    return area


def judged(rows: list[dict[str, object]]) -> list[Contrast]:
    return judge_all(read_study_runs([{key: str(value) for key, value in row.items()} for row in rows]))


def test_every_question_is_answered_by_its_runs() -> None:
    found = judged(made_rows(some_gain))
    assert Counter(one.question for one in found) == {1: 21, 2: 3, 3: 3, 4: 12, 6: 6}
    says = {(one.question, one.where, one.what): one.verdict for one in found}
    for pair in ("high", "low", "lowest"):
        assert says[1, pair, "FTW less scratch"] is says[1, pair, "FTW less FT4"] is Verdict.more
        assert says[1, pair, "FE3 less scratch"] is Verdict.equal
    assert says[3, "imazu", "FTW less scratch"] is Verdict.more
    # FE4 of another case ends lower than that of the target.
    assert {one.verdict for one in found if one.question == 2} == {Verdict.less}
    # 0.4 and 0.7 from drawn starts, and 0.3 by a replay.
    assert {one.verdict for one in found if one.question == 4} == {Verdict.more}
    # The learner that is best on even seeds is bad on odd ones.
    tuned = {one.what.split()[0]: one for one in found if one.question == 6}
    assert all(learner_label(LEARNERS[0]) in one.what for one in tuned.values())
    assert tuned["FTW"].value == pytest.approx(0.3, abs=0.05)
    assert 1 - tuned["FTW"].possible_gain == pytest.approx(0.2, abs=0.05)


def test_pixels_have_no_problems_and_no_other_learners() -> None:
    sizes = replace(SIZES["pixels"], scratch=6, arm=5)
    found = judged(made_rows(some_gain, "pixels", sizes))
    assert Counter(one.question for one in found) == {1: 21, 2: 3, 4: 9}


def test_many_contrasts_are_adjusted() -> None:
    alone = Contrast(1, "", "", 0.1, 0.0, 0.2, 1.0, 0.02, 1.0, "")
    assert judge([alone])[0].verdict is Verdict.more
    assert {one.verdict for one in judge([alone] * 4)} == {Verdict.open}


def test_answers_are_printed_drawn_and_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    small = replace(SIZES["numbers"], scratch=4, arm=4, problem=2, tuned=4)
    monkeypatch.setattr(answers, "FOLDER", tmp_path)
    monkeypatch.setitem(answers.SIZES, "numbers", small)
    monkeypatch.setattr(answers, "POLICIES", ("keep_course",))
    rows = made_rows(some_gain, sizes=small)
    write_csv(tmp_path / "numbers.csv", rows)
    answers.main(["numbers"])
    printed = capsys.readouterr().out
    assert "FTW less scratch" in printed and "keep_course" in printed and "FE4 of the target" in printed
    assert (tmp_path / "numbers.png").stat().st_size > 10_000
    assert (tmp_path / "numbers_answers.csv").read_text().count("\n") == 46
    write_csv(tmp_path / "numbers.csv", rows[:-3])
    with pytest.raises(SystemExit):
        answers.main(["numbers"])
    assert "3 runs are missing" in capsys.readouterr().err
    wrong = {
        "has a run twice": [*rows, rows[-1]],
        "has a share that is not from 0 to 1": [*rows[:-1], rows[-1] | {"perturbed": float("nan")}],
        "has wrong numbers": [*rows[:-1], rows[-1] | {"greedy": "nan " * 16}],
        "it has no column 'perturbed'": [{k: v for k, v in row.items() if k != "perturbed"} for row in rows],
        "it has no rows": [],
    }
    for message, made in wrong.items():
        write_csv(tmp_path / "numbers.csv", made or rows)
        if not made:
            header = (tmp_path / "numbers.csv").read_text().split("\n")[0]
            (tmp_path / "numbers.csv").write_text(header + "\n")
        with pytest.raises(SystemExit) as error:
            answers.main(["numbers"])
        assert error.value.code == 1 and message in capsys.readouterr().err


@pytest.mark.parametrize("text", ["target,source\n1,2\n", ""])
def test_a_table_of_something_else_is_refused(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(answers, "FOLDER", tmp_path)
    (tmp_path / "numbers.csv").write_text(text)
    with pytest.raises(SystemExit) as error:
        answers.main(["numbers"])
    assert error.value.code == 1 and "numbers.csv" in capsys.readouterr().err
