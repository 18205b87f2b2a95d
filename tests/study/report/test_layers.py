"""How alike layers are, as a table and as a figure."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.study.report.gains import draw_layers
from ship_trl.study.report.tables import layer_rows
from ship_trl.study.statistics import interquartile_mean
from ship_trl.study.tables import LAYER_TYPES, OTHER_SEED, SCRATCH, UNTRAINED, read_layers, write_layers
from tests.study.synthetic import make_study

NAMES = ("conv1", "conv2")
ALIKE = np.linspace(0.8, 0.99, 8)
STUDY = replace(
    make_study({("pairs", "high", "scratch"): 0.9}, seeds=8),
    layers=pd.DataFrame(
        [
            (seed, "high", SCRATCH, beside, name, cka - 0.1 * number)
            for seed, cka in enumerate(ALIKE)
            for number, name in enumerate(NAMES)
            for beside in (UNTRAINED, OTHER_SEED)
            if seed < 3 or beside == UNTRAINED
        ],
        columns=list(LAYER_TYPES),
    ),
)


def test_each_layer_of_each_two_networks_has_a_row() -> None:
    rows = {(row["beside"], row["layer"]): row for row in layer_rows(STUDY)}
    assert set(rows) == {(beside, name) for beside in (UNTRAINED, OTHER_SEED) for name in NAMES}
    for number, name in enumerate(NAMES):
        row = rows[UNTRAINED, name]
        assert (row["pair"], row["arm"], row["seeds"]) == ("high", SCRATCH, 8)
        assert row["cka"] == pytest.approx(interquartile_mean(ALIKE - 0.1 * number))
        assert row["cka low"] < row["cka"] < row["cka high"]
    # Too few seeds have no interval.
    few = rows[OTHER_SEED, "conv1"]
    assert few["seeds"] == 3 and few["cka"] == pytest.approx(ALIKE[:3].mean()) and math.isnan(few["cka low"])


def test_what_was_not_measured_has_neither_rows_nor_a_figure() -> None:
    bare = replace(STUDY, layers=None)
    assert layer_rows(bare) == [] and draw_layers(bare) is None


def test_a_layer_without_a_number_is_kept_and_a_wrong_seed_is_refused(tmp_path: Path) -> None:
    path, row = tmp_path / "layers.csv", (1, "high", SCRATCH, UNTRAINED, "conv1", math.nan)
    write_layers(path, pd.DataFrame([row], columns=list(LAYER_TYPES)))
    assert read_layers(path).loc[0, "cka":].isna().all()
    path.write_text(path.read_text().replace("\n1,", f"\n{10**20},"))
    with pytest.raises(ConfigError, match="is not a table of layers"):
        read_layers(path)
