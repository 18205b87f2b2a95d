"""The soak sees what grows."""

import os
import tempfile
from pathlib import Path

import pytest

from ship_trl.study.plan.config import to_study
from ship_trl.study.plan.jobs import plan_jobs
from tests.soak import MEASURED, STUDY, grown, one_run, one_study, soak

FLAT = (400.0, 12.0, 3.0, 1.0, 0.0, 0.0)


def test_what_stays_is_not_named() -> None:
    # What is loaded at the beginning is no growth.
    assert grown([(100.0, 5.0, 1.0, 1.0, 0.0, 0.0)] * 20 + [FLAT] * 80) == []


@pytest.mark.parametrize("column", range(len(MEASURED)))
def test_what_grows_is_named(column: int) -> None:
    rows = [
        tuple(value + (n if place == column else 0) for place, value in enumerate(FLAT)) for n in range(100)
    ]
    found = grown(rows)
    assert len(found) == 1 and found[0].startswith(MEASURED[column])


def test_what_is_left_on_the_disk_is_measured(tmp_path: Path) -> None:
    """In the output before it is taken away, in the working folder, and where temporary files are."""
    place, known = Path.cwd(), tempfile.gettempdir()

    def leave(number: int, folder: Path) -> None:
        (folder / "out").mkdir()
        (folder / "out/result.json").write_bytes(bytes((number + 1) << 20))
        Path(f"left{number}").write_bytes(bytes(1024))
        os.close(tempfile.mkstemp()[0])

    rows = soak(leave, 0.05, tmp_path)
    assert [row[3:] for row in rows] == [(n, 2 * n, n) for n in range(1, len(rows) + 1)]
    assert (Path.cwd(), tempfile.gettempdir()) == (place, known)


def test_a_run_is_measured(tmp_path: Path) -> None:
    (row,) = soak(one_run, 0.1, tmp_path)
    assert all(value > 0 for value in row[:4]) and row[4:] == (0, 0)


def test_the_study_is_one_that_can_be_run() -> None:
    assert plan_jobs(to_study([*STUDY, "first_seed=3", "output=out"]))


@pytest.mark.long
def test_a_study_is_measured(tmp_path: Path) -> None:
    (row,) = soak(one_study, 0.1, tmp_path)
    assert all(value > 0 for value in row[:4])
