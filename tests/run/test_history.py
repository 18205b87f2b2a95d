"""The rows of a curve: numbers in CSV, wandb and TensorBoard, and the best network of them."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import torch
from torch import nn

from ship_trl.files.record import Evaluation
from ship_trl.learn.rollout import Episode
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run.history import History, to_evaluation, to_numbers, to_row
from ship_trl.run.plan import make_run
from ship_trl.run.trackers import Trackers
from ship_trl.run.trackers.csv import CsvTracker
from tests.config.test_config import composed


def episode(outcome: str, episode_return: float, dcpa: float) -> Episode:
    made = torch.zeros(3, 4), torch.zeros(2, dtype=torch.int64), None, torch.tensor([0.0, episode_return])
    return Episode(*made, outcome == "goal", outcome == "collision", dcpa)


EPISODE = episode("collision", -3.5, 44.0)
FINISHED = Finished(3, 90, 0.5, 0.1 + 0.2, 30, "goal", math.inf, None)


def test_numbers_are_named_by_chart() -> None:
    trained, greedy = to_numbers(to_row(FINISHED)), to_numbers(to_row(Evaluated(3, 90, [EPISODE])))
    assert (trained["train/return"], trained["train/goal"], trained["train/collision"]) == (0.1 + 0.2, 1, 0)
    assert (greedy["greedy/return"], greedy["greedy/goal"], greedy["greedy/collision"]) == (-3.5, 0, 1)
    assert all(name.startswith("train/") for name in trained) and "train/loss" not in trained
    assert all(name.startswith("greedy/") for name in greedy) and "greedy/episode" not in greedy


def test_csv_keeps_every_digit_and_is_flushed_after_each_row(tmp_path: Path) -> None:
    run = make_run(composed("target=1", "method=scratch"))
    tracker = CsvTracker(replace(run, folder=tmp_path))
    tracker.begin()
    tracker.log(to_row(FINISHED))
    with (tmp_path / "curve.csv").open() as file:  # before it is closed
        (first,) = csv.DictReader(file)
    assert float(first["return"]) == 0.1 + 0.2 and first["loss"] == "" and first["dcpa"] == ""
    tracker.log(to_row(Evaluated(3, 90, [EPISODE])))
    tracker.close(failed=False)
    with (tmp_path / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[1]["greedy_outcome"] == "collision" and rows[1]["return"] == ""


def test_a_new_run_replaces_an_unfinished_one(tmp_path: Path) -> None:
    run = make_run(composed("target=1", "method=scratch", f"output={tmp_path}"))
    run.folder.mkdir(parents=True)
    (run.folder / "curve.csv").write_text("left over")
    with Trackers(run) as tracker:
        tracker.log(to_row(FINISHED))
    assert sorted(p.name for p in run.folder.iterdir()) == ["checkpoint", "config.yaml", "curve.csv"]
    assert "left over" not in (run.folder / "curve.csv").read_text()


def test_an_evaluation_is_the_mean_of_its_episodes() -> None:
    goal, crash, late = episode("goal", 80, 90), episode("collision", -300, 20), episode("timeout", -20, 50)

    def summarise(*episodes: Episode) -> Evaluation:
        return to_evaluation(to_row(Evaluated(7, 100, list(episodes))))

    assert summarise(goal, goal, crash, late) == Evaluation(-40.0, "goal", 2, 20.0, 7, 0.5, 4)
    # Ties towards the worse.
    assert summarise(goal, late, crash).outcome == "collision"
    assert summarise(goal, late).outcome == "timeout"
    assert summarise(episode("goal", 80, math.inf)) == Evaluation(80.0, "goal", 2, None, 7, 1.0)


def test_the_best_evaluation_has_the_highest_mean_return_and_of_equals_is_the_latest() -> None:
    history, weights = History(nn.Linear(1, 1)), nn.Linear(1, 1)  # type: ignore[arg-type]
    rows = [
        to_row(Evaluated(n, n, [episode("goal", first, 1.0), episode("goal", second, 1.0)]))
        for n, (first, second) in enumerate([(90, 0), (40, 50), (50, 50), (120, -30)])
    ]
    assert [history.add(row, weights) for row in rows] == [True, True, True, False]
    assert history.best == rows[2]
