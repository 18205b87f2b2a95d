"""A source network is trained once, and a transfer is compared with runs from scratch of its settings."""

import dataclasses
import threading
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from ship_trl.files.curve import read_curve, split
from ship_trl.files.record import RunRecord
from ship_trl.run import experiment
from ship_trl.run.experiment import conclude, find_source, run_experiment, scratch_returns
from ship_trl.run.plan import CHECKPOINTS, Run, TakenError, find_result, make_run
from tests.a_result import a_result
from tests.command import SMOKE, ship_trl
from tests.config.test_config import composed


@pytest.fixture
def trained(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Replace the training, and list the folders of the runs that were trained."""
    folders: list[Path] = []

    def train_run(run: Run, *_: Any) -> RunRecord:
        folders.append(run.folder)
        run.folder.mkdir(parents=True)
        for name in ("policy.safetensors", "config.yaml"):
            (run.folder / name).write_text(name)
        return a_result()

    monkeypatch.setattr(experiment, "train_run", train_run)
    return folders


def test_a_transfer_waits_for_another_process_that_trains_its_source(
    tmp_path: Path, trained: list[Path]
) -> None:
    run = make_run(composed("+pair=high", "layers=3", "profile=smoke", f"output={tmp_path}"))
    assert run.source is not None
    asking = threading.Thread(target=find_source, args=(run.source, run.title, "1 of 1"))
    with run.source.lock():  # as `target=1 method=scratch` holds it while it trains
        asking.start()
        asking.join(0.5)
        assert asking.is_alive() and trained == []
    asking.join(10)
    assert trained == [run.source.folder]
    entry = find_source(run.source, run.title, "1 of 1")
    assert entry.policy.is_file() and len(trained) == 1


def test_a_run_that_another_process_finished_meanwhile_is_not_overwritten(
    tmp_path: Path, trained: list[Path]
) -> None:
    """For example two settings of one grid that share a folder."""
    line = ("target=1", "method=scratch", "profile=smoke", f"output={tmp_path}")
    one, other = make_run(composed(*line)), make_run(composed(*line, "learn.lr=1e-3"))
    one.folder.mkdir(parents=True)
    dataclasses.replace(a_result(), config_hash=one.config_hash).write(one.folder)
    with pytest.raises(TakenError, match="a finished run of other settings"):
        run_experiment(other)
    assert trained == [] and find_result(one) is not None


def test_a_perturbed_run_has_no_best_known_return_and_evaluates_alike(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ("target=4", "method=scratch", "profile=smoke", "learn.warmup_steps=9999", f"output={tmp_path}")
    more = ("learn.jumpstart_draws=0", "perturbation.own_position=60", "learn.evaluate_episodes=5")
    run = make_run(composed(*line, *more))
    result = run_experiment(run)
    assert result.best_known_return is None and result.final.episodes == 5
    # Without updates each evaluation is the same, because it has the same starts.
    greedy = split(read_curve(run.folder))[1]
    assert len(greedy) == 3 and greedy["return"].nunique() == 1
    trained = split(read_curve(run.folder))[0]
    assert trained["return"].nunique() == len(trained)
    assert "best known" not in capsys.readouterr().out


def planned(*words: str) -> Run:
    return make_run(composed(*words))


def test_the_shipped_settings_have_five_seeds() -> None:
    found = scratch_returns(planned("+pair=high", "+arm=FT3"))
    assert found is not None and found.shape == (5, 600)


@pytest.mark.parametrize("change", ["learn.gamma=0.9", "world.safe_distance=50"])
def test_other_settings_have_none(change: str) -> None:
    assert scratch_returns(planned("+pair=high", "+arm=FT3", change)) is None


def test_checkpoints_are_kept_until_the_network_is_stored(monkeypatch: pytest.MonkeyPatch) -> None:
    run = planned("target=1", "method=scratch", "output=runs", "case_base=base")
    (run.folder / CHECKPOINTS).mkdir(parents=True)
    # Its folder has no network, as on a full disk.
    with pytest.raises(OSError, match="policy"):
        conclude(run, a_result())
    assert (run.folder / CHECKPOINTS).is_dir()


@pytest.mark.long
def test_an_own_scratch_run_is_drawn_beside_a_transfer(tmp_path: Path) -> None:
    line = ("+pair=high", "+arm=FT3", *SMOKE)
    told = ship_trl(*line, "output=runs", folder=tmp_path)
    assert "no run from scratch of these settings" in told.stdout
    assert not list(tmp_path.rglob("transfer.png"))
    ship_trl("target=2", "method=scratch", *SMOKE, "output=runs", folder=tmp_path)
    found = scratch_returns(planned(*line, "output=runs"))
    path = Path("runs/2/scratch/seed=0")
    curve = split(read_curve(path))[0]
    assert found is not None and found.tolist() == [curve["return"].tolist()]
    assert scratch_returns(planned(*line, "output=elsewhere")) is None
    told = ship_trl(*line, "output=runs", "seed=1", folder=tmp_path, pictures=True)
    picture = tmp_path / "runs" / "high" / "FT3" / "seed=1" / "transfer.png"
    assert "beside learning from scratch: runs/high/FT3/seed=1/transfer.png" in told.stdout
    with Image.open(picture) as drawn:
        assert drawn.size == (1200, 750)
    # A truncated curve is skipped.
    (path / "curve.csv").write_text("".join((path / "curve.csv").read_text().splitlines(keepends=True)[:-2]))
    assert scratch_returns(planned(*line, "output=runs")) is None
