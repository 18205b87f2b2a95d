"""The adversary: the scenes that it finds fail, keep the suite's bounds, and are the same for a seed."""

import numpy as np
import pytest
import torch

from ship_trl.config.types import World
from ship_trl.policies.adversary import CHILDREN, change, keep_speeds, search
from ship_trl.policies.exam import are_drawn, are_solvable, place_ships, run_scenes
from tests.policies.test_exam import entry, some_states


@pytest.mark.parametrize("is_random", [False, True])
def test_found_scenes_fail_and_keep_the_bounds(is_random: bool, world: World) -> None:
    vo = entry("vo", world)
    found, again = (search(vo, 2, 6, 200, 3, is_random) for _ in range(2))
    assert np.array_equal(found.tries, again.tries) and torch.equal(found.scenes, again.scenes)
    assert len(found.scenes) == np.isfinite(found.tries).sum() > 0
    assert found.tries.max() > CHILDREN  # so that scenes were changed
    ends = run_scenes(vo, found.scenes)
    assert not ends.goal.any() and ends.collision.tolist() == found.collision.tolist()
    traffic = vo.suite.traffic
    assert traffic is not None
    assert are_drawn(found.scenes, traffic).all() and keep_speeds(found.scenes, traffic).all()
    assert are_solvable(found.scenes, world).all()


def test_changed_scenes_keep_the_bounds(world: World) -> None:
    vo, states = entry("vo", world), some_states(world, 400, ships=2)
    traffic = vo.suite.traffic
    assert traffic is not None
    changed, kept = change(states, np.full(400, 0.2), vo, np.random.default_rng(0))
    assert 40 < kept.sum() < 360 and not torch.equal(changed, states)
    some = changed[torch.from_numpy(kept)]
    assert (are_drawn(some, traffic) & keep_speeds(some, traffic) & are_solvable(some, world)).all()
    # Fast ships only overtake: 20 and 10 m/s from ahead, 20 m/s from astern.
    states = some_states(world, 3)
    numbers = [[np.pi, 20.0, 20.0, 0.0], [np.pi, 10.0, 20.0, 0.0], [0.0, 20.0, 20.0, 0.0]]
    place_ships(states, np.array(numbers)[:, None])
    assert keep_speeds(states, traffic).tolist() == [False, True, True]


def test_a_search_changes_scenes(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    vo = entry("vo", world)
    drawn, changed = (search(vo, 2, 6, 400, 3, is_random) for is_random in (True, False))
    assert drawn.tries.tolist() != changed.tries.tolist()


def test_a_policy_that_never_fails_ends_the_search(world: World) -> None:
    shares = list[float]()
    found = search(entry("keep_course+shield", world), 1, 2, 2 * CHILDREN, show=shares.append)
    assert found.tries.tolist() == [np.inf, np.inf] and not len(found.scenes) and shares == [0.0, 0.5]
