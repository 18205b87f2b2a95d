"""`python -m tests.soak [--minutes N] [--study]`: train again and again, and measure what this process keeps.

Runs have different seeds; every fourth is a transfer with frozen layers. All write to one folder, which is
measured and removed after each, so memory, open files, threads and disk should stay as they are. With
`--study` studies follow each other in processes of their own, and their parent is measured.
The exit code is 1 if something grew, or if fewer than ten were done.
"""

import argparse
import contextlib
import io
import os
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ship_trl.cli.study import main as run_study
from ship_trl.run.experiment import run_experiment
from ship_trl.run.plan import make_run
from tests.config.test_config import composed

RUN = ("profile=smoke", "learn.episodes=30", "learn.jumpstart_draws=3", "checkpoint.seconds=0")
STUDY = (
    *("profile=smoke", "pairs=[high]", "arms=[scratch,FE3]", "controls=false", "reuse=false", "seeds=2"),
    "overrides=[learn.episodes=20,learn.jumpstart_draws=3]",
)
MEASURED = ("MB resident", "open files", "threads", "MB of output", "files left over", "kB left over")
# Growth that is reported: by this share, and by more than so many.
MIN_SHARE, MIN_GROWTH = 0.05, 2


def measure(output: Path, elsewhere: Path) -> tuple[float, ...]:
    """Measure this process, its output, and the files left in other places, as `MEASURED` names them."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    files = len(list(Path("/proc/self/fd").iterdir()))
    written, left = (
        [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
        for folder in (output, elsewhere)
    )
    memory = int(status["VmRSS"].split()[0]) / 1024
    return memory, files, int(status["Threads"]), sum(written) / 2**20, len(left), sum(left) / 2**10


@contextlib.contextmanager
def working_in(folder: Path) -> Iterator[None]:
    """Work in a folder, with a folder of its own for temporary files, also of children."""
    (folder / "temporary").mkdir(parents=True)
    environment, before = dict(os.environ), tempfile.tempdir
    # joblib's would be in shared memory.
    os.environ |= dict.fromkeys(("TMPDIR", "JOBLIB_TEMP_FOLDER"), str(folder / "temporary"))
    tempfile.tempdir = None
    try:
        with contextlib.chdir(folder):
            yield
    finally:
        os.environ.clear()
        os.environ |= environment
        tempfile.tempdir = before


def one_run(number: int, folder: Path) -> None:
    """Train once."""
    arm = ("+pair=high", "+arm=FE3") if number % 4 == 3 else ("target=4", "method=scratch")
    run_experiment(make_run(composed(*RUN, *arm, f"seed={number}", f"output={folder}/out")))


def one_study(number: int, folder: Path) -> None:
    """Make a study of two seeds."""
    run_study([*STUDY, f"first_seed={number}", f"output={folder}/out"])


def soak(work: Callable[[int, Path], None], seconds: float, folder: Path) -> list[tuple[float, ...]]:
    """Work for so many seconds, and return a measurement after each piece of work."""
    rows: list[tuple[float, ...]] = []
    output, end = folder / "out", time.monotonic() + seconds
    with working_in(folder / "elsewhere"):
        while time.monotonic() < end:
            with contextlib.redirect_stdout(io.StringIO()):
                work(len(rows), folder)
            assert any(output.rglob("result.json")), "nothing was trained"
            rows.append(measure(output, folder / "elsewhere"))
            shutil.rmtree(output)
            if len(rows).bit_count() == 1:
                show(len(rows), rows[-1])
    return rows


def show(number: int, row: tuple[float, ...]) -> None:
    """Print a measurement."""
    words = ", ".join(f"{value:.0f} {name}" for value, name in zip(row, MEASURED, strict=True))
    sys.stdout.write(f"after {number}: {words}\n")
    sys.stdout.flush()


def grown(rows: Sequence[tuple[float, ...]]) -> list[str]:
    """Name what is more in the last fifth than in the second, when all is loaded and compiled."""
    fifth = len(rows) // 5
    found = []
    for name, values in zip(MEASURED, zip(*rows, strict=True), strict=True):
        before, after = (statistics.median(part) for part in (values[fifth : 2 * fifth], values[-fifth:]))
        if after > before * (1 + MIN_SHARE) and after > before + MIN_GROWTH:
            found.append(f"{name}: {before:.0f}, and at the end {after:.0f}")
    return found


def main() -> None:
    """Soak, and report what grew."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--study", action="store_true", help="studies in place of runs")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        rows = soak(one_study if options.study else one_run, 60 * options.minutes, Path(folder))
    if len(rows) < 10:
        sys.exit("fewer than ten were done")
    show(len(rows), rows[-1])
    found = grown(rows)
    sys.stdout.write(f"{len(rows)} in {options.minutes:g} minutes; {'; '.join(found) or 'nothing grew'}\n")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
