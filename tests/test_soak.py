"""The soak sees what grows."""

from pathlib import Path

import pytest

from ship_trl.study.plan.config import to_study
from ship_trl.study.plan.jobs import plan_jobs
from tests.soak import MEASURED, STUDY, grown, one_run, one_study, soak

FLAT = (400.0, 12.0, 3.0, 1.0)


def test_what_stays_is_not_named() -> None:
    # What is loaded at the beginning is no growth.
    assert grown([(100.0, 5.0, 1.0, 1.0)] * 20 + [FLAT] * 80) == []


@pytest.mark.parametrize("column", range(len(MEASURED)))
def test_what_grows_is_named(column: int) -> None:
    rows = [
        tuple(value + (n if place == column else 0) for place, value in enumerate(FLAT)) for n in range(100)
    ]
    found = grown(rows)  # type: ignore[arg-type]
    assert len(found) == 1 and found[0].startswith(MEASURED[column])


def test_a_run_is_measured(tmp_path: Path) -> None:
    (row,) = soak(one_run, 0.1, tmp_path)
    assert all(value > 0 for value in row[:3])


def test_the_study_is_one_that_can_be_run() -> None:
    assert plan_jobs(to_study([*STUDY, "first_seed=3", "output=out"]))


@pytest.mark.long
def test_a_study_is_measured(tmp_path: Path) -> None:
    (row,) = soak(one_study, 0.1, tmp_path)
    assert all(value > 0 for value in row[:3])
