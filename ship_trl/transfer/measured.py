"""Gains of transfer between cases, as measured by a study. No torch.

A study's report writes the table (`transfers.csv`). The table of the confirmatory study is bundled.
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
# A table of a hundred transfers has 8,000 bytes.
MAX_TABLE_BYTES = 1_000_000


@dataclass(frozen=True)
class Transfer:
    """The gain of an arm from a source on a target, over scratch with the same exploration.

    Fingerprints identify the cases independently of their names. `gain` is the interquartile mean over
    `seeds` of the difference of areas under the learning curve, as scores. `low` and `high` are its
    simultaneous 95 % interval over all transfers to the target. `epsilon_start` is None for the default; the
    source always learned with the default.
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
        """Return the commands that repeat the transfer; the last one transfers."""
        run = f"python -m ship_trl profile={self.profile}"
        transfer = f"{run} source={self.source} target={self.target} +arm={self.arm}"
        if self.epsilon_start is None:
            return [transfer]
        # Train the source first: a source that the transfer trains would use its epsilon_start too.
        folder = "outputs/source"
        network = f'source_file="{folder}/{self.source}/scratch/seed=0/{POLICY}"'
        start = f"learn.epsilon_start={self.epsilon_start:g}"
        first = f"{run} target={self.source} method=scratch output={folder}"
        return [first, f"{transfer} {start} {shlex.quote(network)}"]


COLUMNS = tuple(field.name for field in fields(Transfer))


def read_transfers(path: Path) -> list[Transfer]:
    """Read a table of transfers.

    Raises:
        ConfigError: it is not a table of transfers; the message names the option `--measured`.
    """
    return read_table(path, COLUMNS, transfer, MAX_TABLE_BYTES, "--measured", f"a report's {TABLE}")


def transfer(row: dict[str, str]) -> Transfer:
    """Convert the cells of a row to a transfer.

    Raises:
        ValueError: a cell is not valid.
    """
    # Names become part of a command that people paste into a shell.
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
    """Select the transfers to a target from other `cases`, the largest lower bound first.

    Cases are matched by fingerprint and renamed to their names here.
    """
    names = {case.fingerprint: case.name for case in cases if case.fingerprint != target.fingerprint}
    found = [
        replace(one, source=names[one.source_fingerprint], target=target.name)
        for one in known
        if one.target_fingerprint == target.fingerprint and one.source_fingerprint in names
    ]
    return sorted(found, key=lambda one: (-one.low, -one.gain, one.source, one.arm))
