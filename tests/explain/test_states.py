"""States are drawn from a seed, split by whole episodes, and cover the sea around."""

import numpy as np
import torch

from ship_trl.explain.states import STATES_PER_EPISODE
from ship_trl.sim.cases import load_world
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.scene import WINDOW
from ship_trl.sim.transition import Transition
from tests.explain.worlds import case_of, some_states


def test_no_episode_is_in_two_parts() -> None:
    drawn = some_states()
    parts = [set(drawn.episode[part]) for part in (drawn.fitted, drawn.checked, drawn.held_out)]
    assert [len(part) for part in parts] == [30, 10, 20]
    assert len(set.union(*parts)) == 60
    assert (np.bincount(drawn.episode) == STATES_PER_EPISODE).all()


def test_the_seed_decides_and_nothing_else() -> None:
    again, other = some_states.__wrapped__(), some_states(seed=1)
    assert torch.equal(some_states().states, again.states)
    assert np.array_equal(some_states().held_out, again.held_out)
    assert not torch.equal(some_states().states, other.states)


def test_states_are_such_as_a_ship_can_be_in() -> None:
    drawn, world = some_states(), load_world()
    motion = Transition(case_of(), world, torch.device("cpu"))
    assert bool((motion.away(drawn.states).norm(dim=-1) > world.safe_distance).all())
    assert bool((motion.goal_distance(drawn.states) > world.goal_distance).all())
    assert bool((drawn.states[:, 3] < world.max_steps).all())
    assert torch.equal(drawn.pixels, Rasteriser(case_of(), world)(drawn.states))
    assert 0.3 < drawn.random.mean() < 0.7


def test_they_lie_all_around() -> None:
    bearing = next(q for q in some_states().quantities if q.name == "bearing of the goal").values
    quarters = np.floor(np.arctan2(bearing[:, 0], bearing[:, 1]) / (np.pi / 2))
    assert {-2, -1, 0, 1} <= set(quarters)


def test_bearing_and_distance_give_back_the_place() -> None:
    drawn = some_states()
    found = {q.name: q for q in drawn.quantities}
    sin, cos = found["bearing of the goal"].values.T
    far = found["distance of the goal"]
    heading, at = drawn.states[:, 2].double().numpy(), drawn.states[:, :2].double().numpy()
    angle = np.arctan2(sin, cos) + heading
    goal = at + far.values * np.stack((np.cos(angle), np.sin(angle)), 1)
    np.testing.assert_allclose(goal, np.broadcast_to(case_of().goal, goal.shape), atol=0.05)
    assert (far.values[far.seen] <= WINDOW).all() and (far.values[~far.seen] > WINDOW).all()
    assert found["bearing of the goal"].seen.all()


def test_a_case_without_ships_has_its_goal_alone() -> None:
    assert {q.thing for q in some_states("1").quantities} == {"the goal"} | {
        "the ship" for _ in case_of("1").target_ships
    }
