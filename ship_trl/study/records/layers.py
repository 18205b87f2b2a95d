"""layers.csv: how similar the layers of a study's networks are. No torch.

Kept tables hold no networks, so this table is written while they exist (`python -m ship_trl layers`).
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
# The table of 15 seeds has 0.2 MB.
MAX_BYTES = 20_000_000
# What an arm is compared with: its source, and scratch of its seed. Scratch is compared with the source, with
# scratch of the seed before, and with random weights.
SOURCE, SCRATCH, OTHER_SEED, UNTRAINED = "source", "scratch", "other seed", "untrained"


class Layer(NamedTuple):
    """The CKA of a layer in an arm's network and in the network `beside` it."""

    seed: int
    pair: str
    arm: str
    beside: str
    layer: str
    cka: float


def read_layers(path: Path) -> list[Layer]:
    """Read a table of layers, or raise a ConfigError."""
    return read_table(path, Layer._fields, layer_of, MAX_BYTES, "table", "a table of layers")


def layer_of(row: dict[str, str]) -> Layer:
    """Read a row from its cells; raise ValueError for a wrong one."""
    words = {name: row[name] for name in ("pair", "arm", "beside", "layer")}
    if not all(map(is_name, words.values())):
        raise ValueError("a row without a name")
    cka = float(row["cka"])
    # The estimate is unbiased, so it may be a little above 1 or below 0. NaN is allowed.
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
