"""How alike the layers of a study's networks are, as a table. No torch.

`layers.csv` may lie beside a study's tables, or in its folder: the tables hold no networks, so it is written
while those are there (`python -m ship_trl layers`).
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ship_trl.config.paths import is_name
from ship_trl.files.disk import replacing
from ship_trl.files.table import read_table

LAYERS = "layers.csv"
# Bytes, at most: a study of 15 seeds has 0.2 million.
LARGEST = 20_000_000
# What an arm's network stands beside: the source that it began with, and the network from scratch of its
# seed. That one stands beside the source too, which is of another case, beside the network from scratch of
# the seed before it if there is one, and beside one of drawn weights.
SOURCE, SCRATCH, OTHER_SEED, UNTRAINED = "source", "scratch", "other seed", "untrained"


class Layer(NamedTuple):
    """CKA of a layer of two networks of a pair: an arm's and the one that it stands `beside`."""

    seed: int
    pair: str
    arm: str
    beside: str
    layer: str
    cka: float


def read_layers(path: Path) -> list[Layer]:
    """Read a table of layers.

    Raises:
        ConfigError: it is none.
    """
    return read_table(path, Layer._fields, layer_of, LARGEST, "table", "a table of layers")


def layer_of(row: dict[str, str]) -> Layer:
    """Make a row of its cells.

    Raises:
        ValueError: they are of none.
    """
    words = {name: row[name] for name in ("pair", "arm", "beside", "layer")}
    if not all(map(is_name, words.values())):
        raise ValueError("a row without a name")
    cka = float(row["cka"])
    # A little above 1 and below 0 are possible, as it is an estimate without bias.
    if math.isinf(cka) or abs(cka) > 2:
        raise ValueError(f"a CKA of {cka:g}")
    return Layer(int(row["seed"]), **words, cka=cka)


def write_layers(path: Path, rows: Sequence[Layer]) -> None:
    """Write a table of layers, by seed."""
    ordered = sorted(rows, key=lambda row: row.seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as draft, draft.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Layer._fields)
        writer.writerows(ordered)
