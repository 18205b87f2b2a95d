"""The rows of a curve, and the best of them."""

import math

import torch
from torch import nn

from ship_trl.files.record import Evaluation
from ship_trl.learn.rollout import Episode
from ship_trl.learn.train import Evaluated
from ship_trl.run.history import History, to_evaluation, to_row


def episode(outcome: str, episode_return: float, dcpa: float) -> Episode:
    made = torch.zeros(3, 4), torch.zeros(2, dtype=torch.int64), None, torch.tensor([0.0, episode_return])
    return Episode(*made, outcome == "goal", outcome == "collision", dcpa)


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
