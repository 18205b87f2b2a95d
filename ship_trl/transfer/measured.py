"""What transfer has gained between two cases, as a study measured it. No torch.

A study's report writes the table (`transfers.csv`); that of the confirmatory study comes with the package.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields
from pathlib import Path

from ship_trl.config import ConfigError
from ship_trl.paths import read_csv
from ship_trl.sim.cases import Case

TABLE = "transfers.csv"
PACKAGED = Path(__file__).parent / TABLE
# Bytes of a table, at most: one of a hundred transfers has 8,000.
LARGEST = 1_000_000


@dataclass(frozen=True)
class Transfer:
    """What an arm gained from a source on a target, over scratch on the same schedule of exploration.

    The fingerprints say what the cases are, whatever they are called. `gain` is the interquartile mean over
    `seeds` of the difference of areas under the learning curve, as scores, from `low` to `high` at 95 %; they
    are not a number for fewer than two seeds. `epsilon_start` is None where it was the usual one.
    """

    source: str
    target: str
    source_fingerprint: str
    target_fingerprint: str
    arm: str
    epsilon_start: float | None
    seeds: int
    gain: float
    low: float
    high: float

    @property
    def sure(self) -> bool:
        """Whether it is surely better than scratch, if it were judged alone."""
        return self.low > 0.0

    @property
    def line(self) -> str:
        """The command that does it."""
        start = "" if self.epsilon_start is None else f" learn.epsilon_start={self.epsilon_start:g}"
        return f"python -m ship_trl source={self.source} target={self.target} +arm={self.arm}{start}"


COLUMNS = tuple(field.name for field in fields(Transfer))


def read_transfers(path: Path) -> list[Transfer]:
    """Read a table of transfers.

    Raises:
        ConfigError: it is none; `--measured` is what it was given as.
    """
    try:
        return [transfer(row) for row in read_csv(path, COLUMNS, LARGEST)]
    except OSError as error:
        raise ConfigError(f"--measured: {path} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ConfigError(f"--measured: {path} is not a report's {TABLE}: {error}") from None


def transfer(row: dict[str, str]) -> Transfer:
    """Make a transfer of a row's cells.

    Raises:
        ValueError: they are of none.
    """
    names = [row[name] for name in ("source", "target", "source_fingerprint", "target_fingerprint", "arm")]
    # They stand in a command that is meant to be pasted.
    if not all(re.fullmatch(r"[\w.-]{1,100}", name) for name in names):
        raise ValueError("a case or an arm that is no name")
    epsilon = None if row["epsilon_start"] == "" else float(row["epsilon_start"])
    gain, low, high = (float(row[name]) for name in ("gain", "low", "high"))
    source, target, base, own, arm = names
    found = Transfer(source, target, base, own, arm, epsilon, int(row["seeds"]), gain, low, high)
    if not (math.isfinite(gain) and found.seeds > 0 and 0.0 <= (epsilon or 0.0) <= 1.0):
        raise ValueError("a gain, a number of seeds or an epsilon that is none")
    return found


def transfers_to(target: Case, known: list[Transfer]) -> list[Transfer]:
    """Return what was measured on a target, whatever it is called, from other cases; best first."""
    own = target.fingerprint
    found = [one for one in known if one.target_fingerprint == own != one.source_fingerprint]
    return sorted(found, key=lambda one: (-one.gain, one.source, one.arm))
