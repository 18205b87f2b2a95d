"""A transfer is compared with runs from scratch of the same settings only."""

from pathlib import Path

import pytest
from PIL import Image

from ship_trl.files.curve import read_curve, split
from ship_trl.grid.compose import compose_config
from ship_trl.run.experiment import scratch_returns
from ship_trl.run.plan import Run, make_run
from tests.command import ship_trl

SMOKE = ("profile=smoke", "learn.episodes=3", "learn.warmup_steps=30", "learn.jumpstart_draws=0")


def run(*words: str) -> Run:
    return make_run(compose_config(*words))


def test_the_shipped_settings_have_five_seeds() -> None:
    found = scratch_returns(run("+pair=high", "+arm=FT3"))
    assert found is not None and found.shape == (5, 600)


@pytest.mark.parametrize("change", ["learn.gamma=0.9", "world.safe_distance=50"])
def test_other_settings_have_none(change: str) -> None:
    assert scratch_returns(run("+pair=high", "+arm=FT3", change)) is None


@pytest.mark.long
def test_an_own_scratch_run_is_drawn_beside_a_transfer(tmp_path: Path) -> None:
    line = ("+pair=high", "+arm=FT3", *SMOKE)
    told = ship_trl(*line, "output=runs", folder=tmp_path)
    assert "no run from scratch of these settings" in told.stdout
    assert not list(tmp_path.rglob("transfer.png"))
    ship_trl("target=2", "method=scratch", *SMOKE, "output=runs", folder=tmp_path)
    found = scratch_returns(run(*line, "output=runs"))
    path = Path("runs/2/scratch/seed=0")
    curve = split(read_curve(path))[0]
    assert found is not None and found.tolist() == [curve["return"].tolist()]
    assert scratch_returns(run(*line, "output=elsewhere")) is None
    told = ship_trl(*line, "output=runs", "seed=1", folder=tmp_path)
    picture = tmp_path / "runs" / "high" / "FT3" / "seed=1" / "transfer.png"
    assert "beside learning from scratch: runs/high/FT3/seed=1/transfer.png" in told.stdout
    with Image.open(picture) as drawn:
        assert drawn.size == (1200, 750)
    # A truncated curve is skipped.
    (path / "curve.csv").write_text("".join((path / "curve.csv").read_text().splitlines(keepends=True)[:-2]))
    assert scratch_returns(run(*line, "output=runs")) is None
