"""Read the gains of transfer between cases that a study measured. No torch.

A study's report writes them to `transfers.csv`. The table of the confirmatory study is bundled.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path

from ship_trl.config.arm import Arm
from ship_trl.config.command import command, override
from ship_trl.config.paths import conf_dir, group_names, is_name
from ship_trl.files.untrusted import read_table
from ship_trl.sim.cases import Case
from ship_trl.transfer.casebase import POLICY

TABLE = "transfers.csv"
BUNDLED_TABLE = Path(__file__).parent / TABLE
# A hundred transfers take 8,000 bytes.
MAX_TABLE_BYTES = 1_000_000


@dataclass(frozen=True)
class Transfer:
    """The gain of an arm on a target from a source, compared with scratch with the same exploration.

    `epsilon_start` is None for the default. `gain` is a difference of areas under the learning curve, as
    scores: the interquartile mean over the seeds. `low` and `high` are its 95 % interval, which is
    simultaneous over all transfers to the target.
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
        """Return the commands that repeat the transfer; if there are two, the first one trains the source."""
        run, target = f"profile={self.profile}", override("target", self.target)
        transfer = run, override("source", self.source), target, f"+arm={self.arm}"
        if self.epsilon_start is None:
            return [command(*transfer)]
        # Train the source with the default epsilon_start. The transfer would train it with its own.
        folder = "outputs/source"
        network = override("source_file", f"{folder}/{self.source}/scratch/seed=0/{POLICY}")
        start = f"learn.epsilon_start={self.epsilon_start:g}"
        first = run, override("target", self.source), "method=scratch", f"output={folder}"
        return [command(*first), command(*transfer, start, network)]


COLUMNS = tuple(field.name for field in fields(Transfer))


def read_transfers(path: Path) -> list[Transfer]:
    """Read a table of transfers.

    Raises:
        ConfigError: it is not a table of transfers; the message names the option `--measured`.
    """
    return read_table(path, COLUMNS, parse_transfer, MAX_TABLE_BYTES, "--measured", f"a report's {TABLE}")


def parse_transfer(row: dict[str, str]) -> Transfer:
    """Convert the cells of a row; raise ValueError if one is invalid."""
    names = ("source", "target", "source_fingerprint", "target_fingerprint", "profile", "arm")
    texts = {name: row[name] for name in names}
    # They become part of a command that people paste into a shell.
    if not all(re.fullmatch(r"\w[\w.-]{0,99}", row[name]) for name in names[:4]):
        raise ValueError("a case name or fingerprint has characters other than letters, digits, _ . -")
    Arm.parse(row["arm"])
    if not is_name(row["profile"]) or not (conf_dir() / "profile" / f"{row['profile']}.yaml").is_file():
        raise ValueError(f"no profile {row['profile']!r:.50}; allowed: {group_names('profile')}")
    start = None if row["epsilon_start"] == "" else float(row["epsilon_start"])
    if start is not None and not 0.0 <= start <= 1.0:
        raise ValueError(f"epsilon_start is {start:g}; allowed: 0 to 1")
    gain, low, high = (float(row[name]) for name in ("gain", "low", "high"))
    if not -math.inf < low <= gain <= high < math.inf:
        raise ValueError(f"gain is {gain:g}; allowed: from low ({low:g}) to high ({high:g})")
    return Transfer(**texts, epsilon_start=start, seeds=int(row["seeds"]), gain=gain, low=low, high=high)


def transfers_to(target: Case, known: Iterable[Transfer], cases: Iterable[Case]) -> list[Transfer]:
    """Select the transfers to a target from other `cases`, the largest lower bound first.

    Cases are matched by fingerprint, and renamed as in `cases`.
    """
    names = {case.fingerprint: case.name for case in cases if case.fingerprint != target.fingerprint}
    selected = [
        replace(one, source=names[one.source_fingerprint], target=target.name)
        for one in known
        if one.target_fingerprint == target.fingerprint and one.source_fingerprint in names
    ]
    return sorted(selected, key=lambda one: (-one.low, -one.gain, one.source, one.arm))
