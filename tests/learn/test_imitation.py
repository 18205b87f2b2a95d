"""The best episode from each start: which is kept, whose turn it is, and that a checkpoint goes on."""

import pytest
import torch
from tensordict import TensorDict

from ship_trl.learn.ppo import BestEpisodes

CPU = torch.device("cpu")


def observe(kept: BestEpisodes, rows: list[tuple[float, int, float, bool]]) -> None:
    """Show a step: state, action, reward and done of each row."""
    states, actions, rewards, done = (torch.tensor(column)[:, None] for column in zip(*rows, strict=True))
    following = TensorDict({"reward": rewards, "done": done}, [len(rows)])
    kept.observe(TensorDict({"state": states, "action": actions[:, 0], "next": following}, [len(rows)]))


def steps(kept: BestEpisodes) -> list[tuple[list[float], list[int], float]]:
    """Return states, actions and return of the episode of each start, as their turns come."""
    taken = [kept.take() for _ in range(len(kept))]
    return [
        (one.steps["state"].flatten().tolist(), one.steps["action"].tolist(), one.episode_return)
        for one in taken
    ]


def two_rows() -> BestEpisodes:
    """Row 0 begins at 0, 0 and 0; row 1 at 5, and ends its second episode, from 0, later."""
    kept = BestEpisodes()
    observe(kept, [(0.0, 1, -1.0, False), (5.0, 0, -1.0, False)])
    observe(kept, [(1.0, 1, 9.0, True), (6.0, 1, -1.0, False)])
    observe(kept, [(0.0, 2, 5.0, True), (7.0, 2, 4.0, True)])
    observe(kept, [(0.0, 0, 1.0, False), (0.0, 2, 6.0, False)])
    return kept


def test_it_keeps_the_best_episode_of_each_start() -> None:
    kept = two_rows()
    from_zero, from_five = ([0.0, 1.0], [1, 1], 8.0), ([5.0, 6.0, 7.0], [0, 1, 2], 2.0)
    assert steps(kept) == [from_zero, from_five]
    observe(kept, [(2.0, 1, 7.0, True), (3.0, 1, 6.0, True)])  # returns 8, as good, and 12
    assert steps(kept) == [([0.0, 3.0], [2, 1], 12.0), from_five]


def test_starts_take_turns() -> None:
    kept = two_rows()
    found = [len(kept.take().steps) for _ in range(5)]
    assert found == [2, 3, 2, 3, 2]


@pytest.mark.parametrize("turns", [0, 1])
def test_a_checkpoint_goes_on_within_an_episode(turns: int) -> None:
    kept, again = two_rows(), BestEpisodes()
    for _ in range(turns):
        kept.take()
    again.load_state_dict({key: value.clone() for key, value in kept.state_dict().items()}, CPU)
    for one in (kept, again):
        observe(one, [(2.0, 1, 8.0, True), (3.0, 1, 0.0, True)])
    assert steps(kept) == steps(again)
    assert steps(kept)[turns][2] == 9.0
