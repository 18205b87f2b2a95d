"""What transfer has gained between two cases, as a study measured it. No torch.

A study's report writes the table (`transfers.csv`); that of the confirmatory study comes with the package.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path

from ship_trl.config.paths import conf_dir
from ship_trl.files.table import read_table
from ship_trl.sim.cases import Case
from ship_trl.transfer.casebase import POLICY

TABLE = "transfers.csv"
PACKAGED = Path(__file__).parent / TABLE
# Bytes of a table, at most: one of a hundred transfers has 8,000.
LARGEST = 1_000_000


@dataclass(frozen=True)
class Transfer:
    """What an arm gained from a source on a target, over scratch with the same exploration.

    The fingerprints say what the cases are, whatever they are called. `gain` is the interquartile mean over
    `seeds` of the difference of areas under the learning curve, as scores, from `low` to `high`: intervals
    that hold together, at 95 %, for all transfers to the target. `epsilon_start` is None where it was the
    usual one; the source learned with the usual one in any case.
    """

    source: str
    target: str
    source_fingerprint: str
    target_fingerprint: str
    profile: str
    arm: str
    epsilon_start: float | None
    seeds: int
    gain: float
    low: float
    high: float

    def commands(self) -> list[str]:
        """Return the commands that do it, of which the last one transfers."""
        run = f"python -m ship_trl profile={self.profile}"
        transfer = f"{run} source={self.source} target={self.target} +arm={self.arm}"
        if self.epsilon_start is None:
            return [transfer]
        # A source that the transfer itself trained would explore as little as the transfer does.
        folder = "outputs/source"
        network = f'source_file="{folder}/{self.source}/scratch/seed=0/{POLICY}"'
        start = f"learn.epsilon_start={self.epsilon_start:g}"
        first = f"{run} target={self.source} method=scratch output={folder}"
        return [first, f"{transfer} {start} {shlex.quote(network)}"]


COLUMNS = tuple(field.name for field in fields(Transfer))


def read_transfers(path: Path) -> list[Transfer]:
    """Read a table of transfers.

    Raises:
        ConfigError: it is none; `--measured` is what it was given as.
    """
    return read_table(path, COLUMNS, transfer, LARGEST, "--measured", f"a report's {TABLE}")


def transfer(row: dict[str, str]) -> Transfer:
    """Make a transfer of a row's cells.

    Raises:
        ValueError: they are of none.
    """
    # They stand in a command that is meant to be pasted.
    names = [row[name] for name in ("source", "target", "source_fingerprint", "target_fingerprint")]
    if not all(re.fullmatch(r"\w[\w.-]{0,99}", name) for name in names):
        raise ValueError("a case that is no name")
    for group in ("profile", "arm"):
        allowed = sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))
        if row[group] not in allowed:
            raise ValueError(f"no {group} {row[group]!r:.50}; allowed: {', '.join(allowed)}")
    start = None if row["epsilon_start"] == "" else float(row["epsilon_start"])
    if start is not None and not 0.0 <= start <= 1.0:
        raise ValueError(f"an epsilon_start of {start:g}; allowed: 0 to 1")
    gain, low, high = (float(row[name]) for name in ("gain", "low", "high"))
    if not -math.inf < low <= gain <= high < math.inf:
        raise ValueError(f"a gain of {gain:g} that is not between {low:g} and {high:g}")
    source, target, base, own = names
    return Transfer(
        source, target, base, own, row["profile"], row["arm"], start, int(row["seeds"]), gain, low, high
    )


def transfers_to(target: Case, known: Iterable[Transfer], cases: Iterable[Case]) -> list[Transfer]:
    """Return what was measured on a target from other `cases`, with the most that is shown first.

    A case is what it was measured as, whatever it was called there; its name here is put in.
    """
    names = {case.fingerprint: case.name for case in cases if case.fingerprint != target.fingerprint}
    found = [
        replace(one, source=names[one.source_fingerprint], target=target.name)
        for one in known
        if one.target_fingerprint == target.fingerprint and one.source_fingerprint in names
    ]
    return sorted(found, key=lambda one: (-one.low, -one.gain, one.source, one.arm))
