"""What a sweeper maximises, and a real sweep with Optuna."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import CURVE, read_curve, split
from ship_trl.files.record import read_run
from ship_trl.grid.callback import objective
from ship_trl.run.plan import Run, make_run
from tests.a_result import a_result, an_evaluation
from tests.command import SMOKE, ship_trl
from tests.config.test_config import composed

LINES = """\
episode,steps,epsilon,return,length,outcome,dcpa,loss,greedy_return,greedy_length,greedy_outcome,greedy_dcpa
0,0,,,,,,,-400.0,60,timeout,
3,90,,,,,,,50.0,40,goal,
6,180,,,,,,,10.0,40,goal,
9,270,,,,,,,20.0,40,goal,
"""
RESULT = a_result(best=an_evaluation(50.0, episode=3), final=an_evaluation(20.0, episode=9))


def finished(folder: Path, *changes: str) -> Run:
    """Return a run of nine episodes, six with exploration, and write its curve."""
    line = ("target=1", "method=scratch", "learn.episodes=9", "learn.epsilon_fraction=0.6")
    run = make_run(composed(*line, f"output={folder}", *changes))
    run.folder.mkdir(parents=True)
    (run.folder / CURVE).write_text(LINES)
    return run


def evaluate(run: Run) -> float:
    return objective(run, replace(RESULT, folder=run.folder))


@pytest.mark.parametrize(
    ("change", "value"), [("objective=late", 15.0), ("objective=final", 20.0), ("objective=best", 50.0)]
)
def test_an_objective_is_a_greedy_return(change: str, value: float, tmp_path: Path) -> None:
    assert evaluate(finished(tmp_path, change)) == value


def test_a_damaged_curve_is_refused_if_the_objective_needs_it(tmp_path: Path) -> None:
    run = finished(tmp_path)
    (run.folder / CURVE).unlink()
    with pytest.raises(ConfigError, match=r"^objective: .*: curve.csv is missing; allowed without a"):
        evaluate(run)


@pytest.mark.long
def test_a_sweep_keeps_its_trials_apart_and_finds_the_best(tmp_path: Path) -> None:
    small = (*SMOKE, "target=1", "method=scratch")
    line = ("+sweep=learning_rate", "hydra.sweeper.n_trials=2", "hydra/launcher=basic", *small)
    said = ship_trl(*line, folder=tmp_path).stdout
    assert said.count("case 1, scratch, seed 0: best") == 2
    place = tmp_path / "outputs/sweep/learning_rate"
    values, rates = [], []
    for trial in range(2):
        folder = place / f"trial={trial}/1/scratch/seed=0"
        assert read_run(folder).episodes == 3
        _, greedy = split(read_curve(folder))
        values.append(greedy["return"].iloc[-1])  # the only one after exploration
        rates.append(yaml.safe_load((folder / "config.yaml").read_text())["learn"]["lr"])
    found = yaml.safe_load((place / "optimization_results.yaml").read_text())
    assert rates[0] != rates[1] and found["best_value"] == max(values)
    assert found["best_params"]["learn.lr"] == pytest.approx(rates[values.index(max(values))])
    # The same command tries the same values, and finds the finished trials.
    assert ship_trl(*line, folder=tmp_path).stdout.count("is already finished") == 2
    # Other settings in the same folder are refused in one line.
    other = (*line, "learn.gamma=0.5")
    refused = ship_trl(*other, folder=tmp_path, code=1).stderr
    assert f"ship_trl: output: {place.relative_to(tmp_path)}/trial=0/1/scratch/seed=0 holds a fin" in refused
    assert "Traceback" not in refused
