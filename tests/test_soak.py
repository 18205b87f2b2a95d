"""The soak sees what grows."""

import os
import tempfile
from pathlib import Path

import pytest

from tests.soak import MEASURED, grown, one_run, one_study, soak

FLAT = (400.0, 12.0, 3.0, 1.0, 0.0, 0.0)


def test_what_grows_is_named() -> None:
    # What is loaded at the beginning is no growth.
    assert grown([(100.0, 5.0, 1.0, 1.0, 0.0, 0.0)] * 20 + [FLAT] * 80) == []
    for column, name in enumerate(MEASURED):
        rows = [tuple(v + n * (place == column) for place, v in enumerate(FLAT)) for n in range(100)]
        (found,) = grown(rows)
        assert found.startswith(name)


def test_what_is_left_on_the_disk_is_measured(tmp_path: Path) -> None:
    """In the output before it is removed, in the working folder, and among temporary files."""
    place, known = Path.cwd(), tempfile.gettempdir()

    def leave(number: int, folder: Path) -> None:
        (folder / "out").mkdir()
        (folder / "out/result.json").write_bytes(bytes((number + 1) << 20))
        Path(f"left{number}").write_bytes(bytes(1024))
        os.close(tempfile.mkstemp()[0])

    rows = soak(leave, 0.05, tmp_path)
    assert [row[3:] for row in rows] == [(n, 2 * n, n) for n in range(1, len(rows) + 1)]
    assert (Path.cwd(), tempfile.gettempdir()) == (place, known)


@pytest.mark.long
@pytest.mark.parametrize(("work", "left"), [(one_run, 0), (one_study, 1)])
def test_real_work_is_measured(work: object, left: int, tmp_path: Path) -> None:
    (row,) = soak(work, 0.1, tmp_path)  # type: ignore[arg-type]
    assert all(value > 0 for value in row[:4]) and (left or row[4:] == (0, 0))
