"""States are drawn from a seed, split by whole episodes, and cover the water around."""

import numpy as np
import torch

from ship_trl.explain.states import STATES_PER_EPISODE
from ship_trl.sim.scene import VIEW_RADIUS
from ship_trl.sim.state import STEP, goal_distance, relative_positions
from tests.explain.worlds import env_of, some_states


def test_no_episode_is_in_two_parts() -> None:
    states = some_states()
    parts = [set(states.episode[part]) for part in (states.training, states.validation, states.held_out)]
    assert [len(part) for part in parts] == [30, 10, 20]
    assert len(set.union(*parts)) == 60
    assert (np.bincount(states.episode) == STATES_PER_EPISODE).all()


def test_states_are_of_running_episodes() -> None:
    states, world = some_states(), env_of().world
    assert bool((relative_positions(states.states).norm(dim=-1) > world.safe_distance).all())
    assert bool((goal_distance(states.states) > world.goal_distance).all())
    assert bool((states.states[:, STEP] < world.max_steps).all())
    assert torch.equal(states.pixels, env_of().rasteriser(states.states))


def test_bearing_and_distance_give_back_the_goal() -> None:
    states = some_states()
    found = {q.name: q for q in states.quantities}
    bearing, distance = found["bearing of the goal"], found["distance of the goal"]
    sin, cos = bearing.values.T
    # The goal is seen on every side.
    assert {-2, -1, 0, 1} <= set(np.floor(np.arctan2(sin, cos) / (np.pi / 2)))
    heading, position = states.states[:, 2].double().numpy(), states.states[:, :2].double().numpy()
    angle = np.arctan2(sin, cos) + heading
    goal = position + distance.values * np.stack((np.cos(angle), np.sin(angle)), 1)
    np.testing.assert_allclose(goal, np.broadcast_to(env_of().case.goal, goal.shape), atol=0.05)
    shown = distance.values[:, 0] <= VIEW_RADIUS
    assert (distance.visible == shown).all() and bearing.visible.all()
