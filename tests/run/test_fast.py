"""With `fast=false` a run needs no compiled loops: numba cannot be imported."""

from pathlib import Path

import pytest
import yaml

from ship_trl.files.record import read_run
from tests.command import ship_trl

# A blocked import raises.
WITHOUT_NUMBA = """
import sys
sys.modules["numba"] = None
"""
LINE = ("profile=smoke", "+pair=high", "method=feature_extraction", "layers=3")


@pytest.mark.long
def test_a_whole_run_needs_no_numba(tmp_path: Path) -> None:
    ship_trl(*LINE, "fast=false", folder=tmp_path, first=WITHOUT_NUMBA, new_process=True)
    folder = tmp_path / "outputs/smoke/high/FE3/seed=0"
    assert read_run(folder).backend == "dense"
    values = yaml.safe_load((folder / "config.yaml").read_text())
    assert values["fast"] is False and values["learn"]["backend"] == "dense"
