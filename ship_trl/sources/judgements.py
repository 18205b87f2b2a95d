"""What measures of similarity are worth, and the measure that won (docs/sources.md). No torch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from ship_trl.files.table import Cells, read_table

# Of the benchmark from numbers.
BUNDLED_TABLE = Path(__file__).parent / "judgements.csv"
MAX_TABLE_BYTES = 1_000_000
# Kinds of measures that cannot win: oracles, and measures fitted to gains.
ORACLE, FITTED = "oracle", "fitted"
# A kind that may win: it asks the network of the source.
SOURCE = "source"


@dataclass(frozen=True)
class Judgement:
    """What a measure is worth for an arm: means over targets with 95 % intervals.

    `kind` is cases, source, oracle or fitted. `top` is the share of targets where the first source is among
    the best three, `gain` the gain of that source, `seconds` the processor time for a pair.
    """

    measure: str
    kind: str
    arm: str
    correlation: float
    correlation_low: float
    correlation_high: float
    regret: float
    regret_low: float
    regret_high: float
    top: float
    top_low: float
    top_high: float
    gain: float
    gain_low: float
    gain_high: float
    seconds: float


COLUMNS = tuple(field.name for field in fields(Judgement))


def read_judgements(path: Path = BUNDLED_TABLE) -> list[Judgement]:
    """Read a table of judgements.

    Raises:
        ConfigError: the file is not such a table.
    """
    return read_table(path, COLUMNS, parse, MAX_TABLE_BYTES, "sources", "a table of judgements")


def parse(row: Cells) -> Judgement:
    """Convert the cells of a row; raise ValueError if a number is not finite."""
    numbers = {name: float(row[name]) for name in COLUMNS[3:]}
    if not all(map(math.isfinite, numbers.values())):
        raise ValueError(f"measure {row['measure']:.50} has a number that is not finite")
    return Judgement(row["measure"], row["kind"], row["arm"], **numbers)


def winner(table: Sequence[Judgement]) -> Judgement:
    """Return the measure with the largest mean correlation over arms, with the arm of its largest gain.

    Neither oracles nor fitted ones can win.
    """
    correlations: dict[str, list[float]] = {}
    for one in table:
        if one.kind not in (ORACLE, FITTED):
            correlations.setdefault(one.measure, []).append(one.correlation)
    best = max(correlations, key=lambda name: sum(correlations[name]) / len(correlations[name]))
    return max((one for one in table if one.measure == best), key=lambda one: one.gain)
