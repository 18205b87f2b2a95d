"""A full disk: the file that cannot be written is named, and the command says so in one line."""

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from ship_trl.run.history import to_row
from ship_trl.run.plan import make_run
from ship_trl.run.trackers.csv import CsvTracker
from ship_trl.transfer.weights import save_weights
from tests.a_result import a_result
from tests.config.test_config import composed
from tests.learn.networks import network
from tests.run.test_tracking import FINISHED


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let no file grow past a number of bytes, as if the disk were full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def write_curve(folder: Path) -> None:
    run = make_run(composed("target=1", "method=scratch", f"output={folder}"))
    tracker = CsvTracker(replace(run, folder=folder))
    tracker.begin()
    try:
        tracker.log(to_row(FINISHED))
    finally:
        tracker.close(failed=True)


WRITERS: dict[str, Callable[[Path], None]] = {
    "curve.csv": write_curve,
    "policy.safetensors": lambda folder: save_weights(folder / "policy.safetensors", network(), {}),
    "result.json": lambda folder: a_result().write(folder),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_that_cannot_be_written_is_named(name: str, tmp_path: Path) -> None:
    WRITERS[name](tmp_path)  # compile first: compiled code is written too
    with pytest.raises(OSError, match="File too large") as raised, largest_file(10):
        WRITERS[name](tmp_path)
    assert Path(raised.value.filename).name == name
    assert not list(tmp_path.rglob(f".{Path(name).stem}*"))  # no draft is left
