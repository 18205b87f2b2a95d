"""`python -m tests.faults [--only KIND] [--seconds N] [--kills N] [--seed N]`: faults, and what survives.

Of each kind faults are made for so many seconds, or until there are so many; the same seed chooses the
same ones. What is lost is said with the folder that it can be seen in. A table ends it, and exit code 1 if
anything is lost.
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

# By its name: the module and the function that makes its trials.
KINDS = {
    "kill-run": ("kills", "of_runs"),
    "kill-study": ("kills", "of_studies"),
    "disk-full": ("disk", "of_full_disks"),
    "disk-closed": ("disk", "of_closed_folders"),
    "together": ("together", "of_two"),
    "clock": ("clock", "of_clocks"),
    "memory": ("memory", "of_studies"),
    "files": ("files", "of_files"),
    "readers": ("readers", "of_readers"),
}


def find(name: str) -> Kind:
    """Find what makes a kind's trials."""
    module, function = KINDS[name]
    made: Kind = getattr(importlib.import_module(f"tests.faults.{module}"), function)
    return made


def trials(name: str, seed: int, seconds: float, faults: int | None) -> tuple[int, int, int, list[str]]:
    """Make faults of a kind; returns how many, how many trials, how many of those survived, what was lost."""
    place = Path(tempfile.mkdtemp(prefix=f"faults-{name}-"))
    tried = count = survived = 0
    lost: list[str] = []
    until = time.monotonic() + seconds
    for trial in find(name)(random.Random(f"{name} {seed}"), place):
        count, tried = count + 1, tried + trial.faults
        survived += not trial.lost
        if trial.lost:
            lost.append(f"{trial.what}: {trial.lost}")
            sys.stdout.write(f"LOST {name}: {lost[-1]}\n")
            sys.stdout.flush()
        if time.monotonic() > until or (faults is not None and tried >= faults):
            break
    if not lost:
        shutil.rmtree(place, ignore_errors=True)
    return tried, count, survived, lost


def main() -> None:
    """Try each kind, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--only", action="append", choices=KINDS, metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--seconds", type=float, default=60.0, metavar="N", help="of each kind (60)")
    parser.add_argument(
        "--kills", type=int, metavar="N", help="so many faults of each kind, in place of a time"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    options = parser.parse_args()
    seconds = options.seconds if options.kills is None else float("inf")
    rows = []
    for name in options.only or KINDS:
        started = time.monotonic()
        tried, count, survived, lost = trials(name, options.seed, seconds, options.kills)
        rows.append((name, tried, count, survived, len(lost), time.monotonic() - started))
    sys.stdout.write(f"{'kind':<14}{'faults':>8}{'trials':>8}{'survived':>10}{'lost':>6}{'seconds':>9}\n")
    for name, tried, count, survived, failed, took in rows:
        sys.stdout.write(f"{name:<14}{tried:>8}{count:>8}{survived:>10}{failed:>6}{took:>9.0f}\n")
    sys.exit(any(row[4] for row in rows))


if __name__ == "__main__":
    main()
