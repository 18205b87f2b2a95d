"""`python -m tests.soak --minutes 120`: one run after another in one process, and what that process holds.

Each run has another seed, and every fourth is a transfer that freezes layers. All are written to the same
folder, case base included, which is measured and taken away after each. What is left then is left elsewhere:
in the working folder or in the one for temporary files, which are the soak's own. So memory, open files,
threads and disk should stay as they are.
With `--study` studies are run one after another, each in processes of its own, and it is their parent that
is looked at.
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
# Of the second fifth of the time, which is after everything is loaded and compiled; and so many of a kind.
GROWTH, MORE = 0.05, 2


def held(output: Path, elsewhere: Path) -> tuple[float, ...]:
    """Measure this process, what it has just written, and what is left elsewhere, as `MEASURED` names it."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    files = len(list(Path("/proc/self/fd").iterdir()))
    written, left = sizes(output), sizes(elsewhere)
    memory = int(status["VmRSS"].split()[0]) / 1024
    return memory, files, int(status["Threads"]), sum(written) / 2**20, len(left), sum(left) / 2**10


def sizes(folder: Path) -> list[int]:
    """Give the size of each file below a folder."""
    return [path.stat().st_size for path in folder.rglob("*") if path.is_file()]


@contextlib.contextmanager
def elsewhere(folder: Path) -> Iterator[None]:
    """Work in a folder of its own, with one for temporary files; the children of this process do too."""
    work, temporary = folder / "work", folder / "temporary"
    work.mkdir(parents=True)
    temporary.mkdir()
    environment, before = dict(os.environ), tempfile.tempdir
    # joblib's would be in the system's shared memory.
    os.environ |= {"TMPDIR": str(temporary), "JOBLIB_TEMP_FOLDER": str(temporary)}
    tempfile.tempdir = None
    try:
        with contextlib.chdir(work):
            yield
    finally:
        os.environ.clear()
        os.environ |= environment
        tempfile.tempdir = before


def one_run(number: int, folder: Path) -> None:
    arm = ("+pair=high", "+arm=FE3") if number % 4 == 3 else ("target=4", "method=scratch")
    run_experiment(make_run(composed(*RUN, *arm, f"seed={number}", f"output={folder}/out")))


def one_study(number: int, folder: Path) -> None:
    run_study([*STUDY, f"first_seed={number}", f"output={folder}/out"])


def soak(work: Callable[[int, Path], None], seconds: float, folder: Path) -> list[tuple[float, ...]]:
    """Work for so many seconds; returns what was held after each piece of it."""
    rows: list[tuple[float, ...]] = []
    output, places = folder / "out", folder / "elsewhere"
    until = time.monotonic() + seconds
    with elsewhere(places):
        while time.monotonic() < until:
            with contextlib.redirect_stdout(io.StringIO()):
                work(len(rows), folder)
            assert any(output.rglob("result.json")), "nothing was trained"
            rows.append(held(output, places))
            shutil.rmtree(output)
            if len(rows) & (len(rows) - 1) == 0:
                say(len(rows), rows[-1])
    return rows


def say(number: int, row: tuple[float, ...]) -> None:
    """One line."""
    words = ", ".join(f"{value:.0f} {name}" for value, name in zip(row, MEASURED, strict=True))
    sys.stdout.write(f"after {number}: {words}\n")
    sys.stdout.flush()


def grown(rows: Sequence[tuple[float, ...]]) -> list[str]:
    """Name what is more in the last fifth than in the second."""
    fifth = len(rows) // 5
    found = []
    for column, name in enumerate(MEASURED):
        values = [row[column] for row in rows]
        before, after = (statistics.median(part) for part in (values[fifth : 2 * fifth], values[-fifth:]))
        if after > before * (1 + GROWTH) and after > before + MORE:
            found.append(f"{name}: {before:.0f}, and at the end {after:.0f}")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--study", action="store_true", help="studies in place of runs")
    options = parser.parse_args()
    if not options.minutes > 0:
        sys.exit(f"--minutes: must be above 0, got {options.minutes:g}")
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        rows = soak(one_study if options.study else one_run, 60 * options.minutes, Path(folder))
    if len(rows) < 10:
        sys.exit("too few were done to tell")
    say(len(rows), rows[-1])
    found = grown(rows)
    sys.stdout.write(f"{len(rows)} in {options.minutes:g} minutes; {'; '.join(found) or 'nothing grew'}\n")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
