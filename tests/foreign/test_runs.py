"""Runs on encounters of other tools: trained, evaluated at their scale and at another one, explained."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import SMOKE, ship_trl
from tests.foreign.test_suites import OWN, save
from tests.formats.test_maritime_schema import ship, situation


@pytest.mark.long
def test_a_run_is_trained_evaluated_and_explained_on_files_of_other_tools(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    for number in range(2):
        target = ship(56.06, 11 + number / 100, sog=12, cog=180)
        one = save(tmp_path / f"scenes/s{number}.json", situation(OWN, target))
    ship_trl("target=scenes", "method=scratch", *SMOKE, folder=tmp_path)
    transfer = "target=scenes/s1.json", "source=scenes/s0.json", "method=finetune", "layers=3"
    ship_trl(*transfer, *SMOKE, folder=tmp_path)
    # From another folder the encounters are those of the run.
    (tmp_path / "elsewhere").mkdir()
    runs = str(tmp_path / "outputs/smoke")
    told = ship_trl(runs, folder=tmp_path / "elsewhere", verb="evaluate")
    assert "scenes: 2 scenes, 0 refused" in told.stderr and "45 m are 0.30 NM" in told.stderr
    told = ship_trl(f"{runs}/s0-s1", "situations.safe=0.2", folder=tmp_path / "elsewhere", verb="evaluate")
    assert "45 m are 0.20 NM" in told.stderr
    told = ship_trl(runs, f"target={one}", folder=tmp_path, verb="evaluate")
    assert "s1.json: 1 scene, 0 refused" in told.stderr
    words = f"{runs}/s0-s1", "--output", "page", "--episodes", "60"
    assert "page" in ship_trl(*words, folder=tmp_path, verb="explain").stdout
