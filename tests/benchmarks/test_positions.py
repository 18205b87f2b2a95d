"""Made-up AIS tables."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks import positions
from ship_trl.config.bounds import KNOT
from ship_trl.foreign.tracks import resample
from ship_trl.formats.ais import read_table


def test_a_table_has_its_rows_and_ships_go_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(positions, "MINUTES", 20)
    positions.write_table(tmp_path / "day.csv", 100)
    fixes = read_table(tmp_path / "day.csv")
    assert len(fixes.ship) == 100 and fixes.ship.max() == 4 and np.isfinite(fixes.course).all()
    speed = np.hypot(*resample(fixes, 60).motion.T)
    assert speed.min() > 5.9 * KNOT and speed.max() < 18.1 * KNOT
