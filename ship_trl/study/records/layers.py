"""layers.csv: how similar the layers of a study's networks are. No torch.

The table lies beside a study's tables, or in its folder. Kept tables hold no networks, so it is written while
the networks exist (`python -m ship_trl layers`).
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ship_trl.config.paths import is_name
from ship_trl.files.disk import atomic_write
from ship_trl.files.table import read_table

LAYERS = "layers.csv"
# A study of 15 seeds has 0.2 million bytes.
MAX_BYTES = 20_000_000
# The networks that an arm is compared with: its source, and scratch of its seed. Scratch is compared with the
# source, with scratch of the seed before, and with random weights.
SOURCE, SCRATCH, OTHER_SEED, UNTRAINED = "source", "scratch", "other seed", "untrained"


class Layer(NamedTuple):
    """CKA of a layer of two networks of a pair: an arm's network and the one `beside` it."""

    seed: int
    pair: str
    arm: str
    beside: str
    layer: str
    cka: float


def read_layers(path: Path) -> list[Layer]:
    """Read a table of layers.

    Raises:
        ConfigError: it is not such a table.
    """
    return read_table(path, Layer._fields, layer_of, MAX_BYTES, "table", "a table of layers")


def layer_of(row: dict[str, str]) -> Layer:
    """Read a row from its cells.

    Raises:
        ValueError: a cell has a wrong value.
    """
    words = {name: row[name] for name in ("pair", "arm", "beside", "layer")}
    if not all(map(is_name, words.values())):
        raise ValueError("a row without a name")
    cka = float(row["cka"])
    # The estimate is unbiased, so it can be a little above 1 or below 0. NaN is allowed.
    if math.isinf(cka) or abs(cka) > 2:
        raise ValueError(f"a CKA of {cka:g}")
    return Layer(int(row["seed"]), **words, cka=cka)


def write_layers(path: Path, rows: Sequence[Layer]) -> None:
    """Write a table of layers, by seed."""
    ordered = sorted(rows, key=lambda row: row.seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as draft, draft.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Layer._fields)
        writer.writerows(ordered)
