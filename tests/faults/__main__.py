"""`python -m tests.faults [--only KIND] [--minutes N] [--seed N]`: make faults and see what survives.

The minutes are shared by the kinds; each makes at least one trial. The seed chooses the faults. A failed
trial is printed with its folder, which is kept. A table ends the output; the exit code is 1 if one failed.
"""

import argparse
import importlib
import random
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.faults.trial import Kind

# The function that makes the trials of a kind: a run or study killed, a full disk, two commands at once, a
# command that reads damaged files, and inputs drawn by Hypothesis.
KINDS = {
    "kill-run": "kills:run_trials",
    "kill-study": "kills:study_trials",
    "full-disk": "disk:trials",
    "together": "together:trials",
    "files": "files:trials",
    "inputs": "inputs:trials",
}


def find(name: str) -> Kind:
    """Import the function that makes the trials of a kind; only what is asked for is imported."""
    module, _, function = KINDS[name].partition(":")
    found: Kind = getattr(importlib.import_module(f"tests.faults.{module}"), function)
    return found


def make_trials(name: str, seed: int, seconds: float) -> tuple[int, int, int]:
    """Make trials of a kind until the time is over; return the numbers of trials, faults and failures."""
    folder = Path(tempfile.mkdtemp(prefix=f"faults-{name}-"))
    trials = faults = failures = 0
    end = time.monotonic() + seconds
    for trial in find(name)(random.Random(f"{name} {seed}"), folder):
        trials, faults = trials + 1, faults + trial.faults
        if trial.problem:
            failures += 1
            sys.stdout.write(f"FAILED {name}: {trial.what}: {trial.problem}\n")
            sys.stdout.flush()
        if time.monotonic() > end:
            break
    if not failures:
        shutil.rmtree(folder, ignore_errors=True)
    return trials, faults, failures


def main() -> None:
    """Make trials of each kind, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--only", action="append", choices=KINDS, metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--minutes", type=float, default=10.0, metavar="N", help="of all kinds together (10)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="chooses the faults (0)")
    options = parser.parse_args()
    if not options.minutes > 0:
        parser.error("--minutes: must be above 0")
    names = options.only or list(KINDS)
    rows = []
    for name in names:
        start = time.monotonic()
        made = make_trials(name, options.seed, 60 * options.minutes / len(names))
        rows.append((name, *made, round(time.monotonic() - start)))
    sys.stdout.write(f"{'kind':<12}{'trials':>8}{'faults':>8}{'failed':>8}{'seconds':>9}\n")
    for name, trials, faults, failures, seconds in rows:
        sys.stdout.write(f"{name:<12}{trials:>8}{faults:>8}{failures:>8}{seconds:>9}\n")
    sys.exit(any(row[3] for row in rows))


if __name__ == "__main__":
    main()
