"""The command that measures any contrast of a study."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ship_trl.cli.study import answers
from ship_trl.study.manifest import NO_PLAN
from ship_trl.study.study import Study
from tests.command import ask as main
from tests.command import ship_trl
from tests.study.synthetic import study_of, write_study

# Ten seeds of a study that is begun with ten, looked at after five.
SCRATCH = np.linspace(0.5, 0.6, 10)
GAINS = np.array([0.1, -0.1, 0.2, 0.1, 0.1, 0.3, 0.3, 0.3, 0.3, 0.3])


def test_seeds_beyond_the_last_look_are_left_out() -> None:
    nine = study_of(scratch=SCRATCH[:9], FE1=(SCRATCH + GAINS)[:9])
    planned = Study(nine.records, plan=replace(NO_PLAN, judged=[*range(10)]))
    assert [one.seeds for one in answers(planned, ["high: FE1 above scratch"])] == [5]
    assert [one.seeds for one in answers(planned, ["high: FE1 above scratch"], seeds=7)] == [7]


def test_pairs_with_too_few_seeds_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    both = {**study_of(scratch=SCRATCH, FE1=SCRATCH).records}
    one = next(iter(both.values()))
    both[("pairs", "low", "scratch", 0)] = both[("pairs", "low", "FE1", 1)] = one
    (found,) = answers(Study(both), ["every pair: FE1 above scratch"])
    assert found.what == "high: FE1 above scratch (area)"
    told = "every pair: FE1 above scratch: 1 of 2 contrasts lack two common seeds; left out"
    assert capsys.readouterr().err == f"ship_trl: {told}\n"


def test_it_is_a_table_of_a_line_a_contrast(tmp_path: Path) -> None:
    write_study(tmp_path, seeds=2, pairs=("high", "low", "lowest"))
    told = ship_trl(
        *(str(tmp_path), "every pair: FTW above scratch", "low: FE1 sooner than FE2 (time)"),
        folder=tmp_path,
        verb="study ask",
    ).stdout
    rows = [line.split("  ")[0] for line in told.splitlines() if ": F" in line]
    pairs = [f"{pair}: FTW above scratch (area)" for pair in ("high", "low", "lowest")]
    assert rows == [*pairs, "low: FE1 sooner than FE2 (time)"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["study", "high: FE9 above scratch"], "question: no arm 'FE9' in high"),
        (["study", "high: FE1 above scratch", "--seeds", "3"], "--seeds: must be from 1 to 2"),
        (
            ["study", "high: FE1 above scratch", "--seeds", "1"],
            "question: 'high: FE1 above scratch' needs the metric",
        ),
        (
            ["study", "high: FE1 (forgetting)"],
            "question: 'high: FE1 (forgetting)' needs the metric of all",
        ),
        (
            ["empty", "high: FE1 above scratch"],
            "folder: no finished run below empty; python -m ship_trl study",
        ),
    ],
)
def test_wrong_input_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    write_study(tmp_path / "study", seeds=2)
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    said = capsys.readouterr().err
    assert ended.value.code == 1 and said.startswith(f"ship_trl: {told}") and said.count("\n") == 1
