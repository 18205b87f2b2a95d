"""Read the gains of transfer between cases that a study measured. No torch.

A study's report writes them to `transfers.csv`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from ship_trl.config.arm import Arm
from ship_trl.config.errors import command, override
from ship_trl.config.paths import conf_files, group_names
from ship_trl.config.schema import read_as, rule
from ship_trl.files.untrusted import Cells, read_table
from ship_trl.sim.cases import Case
from ship_trl.transfer.casebase import POLICY

TABLE = "transfers.csv"
# A hundred transfers take 8,000 bytes.
MAX_TABLE_BYTES = 1_000_000
# They become part of a command that people paste into a shell.
Word = Annotated[
    str, rule("letters, digits, _ . -", lambda word: bool(re.fullmatch(r"\w[\w.-]{0,99}", word)))
]
Profile = Annotated[str, rule(f"one of {group_names('profile')}", lambda one: one in conf_files("profile"))]


@dataclass(frozen=True)
class Transfer:
    """The gain of an arm on a target from a source, compared with scratch with the same exploration.

    `epsilon_start` is None for the default. `gain` is a difference of areas under the learning curve, as
    scores: the interquartile mean over the seeds. `low` and `high` are its 95 % interval, which is
    simultaneous over all transfers to the target.
    """

    source: Word
    target: Word
    source_fingerprint: Word
    target_fingerprint: Word
    profile: Profile
    arm: str
    epsilon_start: Annotated[float, Field(ge=0, le=1)] | None
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

    def make(row: Cells) -> Transfer:
        Arm.parse(row["arm"])
        cells = {name: row[name] for name in COLUMNS}
        found = read_as(Transfer, cells | {"epsilon_start": row["epsilon_start"] or None})
        if not found.low <= found.gain <= found.high:
            raise ValueError(f"gain is {found.gain:g}; allowed: {found.low:g} to {found.high:g}")
        return found

    return read_table(path, COLUMNS, make, MAX_TABLE_BYTES, "--measured", f"a report's {TABLE}")


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
