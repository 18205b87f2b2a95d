"""The table of what measures are worth, and which of them wins."""

from dataclasses import asdict, replace
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.sources.judgements import Judgement, read_judgements, winner
from ship_trl.study.report.tables import write_csv

ROW = Judgement("a", "cases", "FTW", *([0.1] * 13))


def test_neither_an_oracle_nor_a_fitted_measure_wins() -> None:
    table = [
        ROW,
        replace(ROW, measure="b", kind="source", correlation=0.2),
        replace(ROW, measure="c", kind="oracle", correlation=0.9),
        replace(ROW, measure="d", kind="fitted", correlation=0.9),
    ]
    assert winner(table).measure == "b"


def test_the_mean_over_arms_decides_and_then_the_arm_that_gains_most() -> None:
    other = replace(ROW, measure="b", correlation=0.5)
    table = [
        *(replace(ROW, arm=arm, correlation=0.3, gain=gain) for arm, gain in (("FE2", 0.1), ("FTW", 0.4))),
        *(replace(other, arm=arm, correlation=value) for arm, value in (("FE2", 0.5), ("FTW", -0.2))),
    ]
    assert (winner(table).measure, winner(table).arm) == ("a", "FTW")


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_csv(tmp_path / "x.csv", [asdict(ROW)])
    assert read_judgements(tmp_path / "x.csv") == [ROW]


@pytest.mark.parametrize("gain", ["nan", "x", ""])
def test_a_number_that_is_none_is_refused(gain: str, tmp_path: Path) -> None:
    write_csv(tmp_path / "x.csv", [asdict(ROW) | {"gain": gain}])
    with pytest.raises(ConfigError, match=r"x\.csv is not a table of judgements"):
        read_judgements(tmp_path / "x.csv")
