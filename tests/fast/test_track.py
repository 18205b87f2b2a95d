"""What has happened to each target ship: the compiled loop equals torch, on episodes of random policies."""

from __future__ import annotations

import pytest
import torch

from ship_trl.fast.track import CompiledTracker
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.sim.cases import load_suite, load_world
from ship_trl.sim.encounter import Encounter, Tracker
from ship_trl.sim.state import SHIP_ACTION, SHIP_CLASS, SHIP_TURN, is_present, target_ships

WORLD = load_world()


@pytest.mark.parametrize("name", ["traffic", "traffic_reacting", "1"])
def test_the_compiled_loop_equals_torch(name: str) -> None:
    suite, generator = load_suite(name, WORLD), torch.Generator().manual_seed(0)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 100, 0))
    fast, slow = CompiledTracker(Tracker(WORLD)), Tracker(WORLD)
    step, found = env.reset(), set()
    for _ in range(40):
        # Few numbers lie so near to a bound that rounding decides.
        action = torch.randint(7, (100,), generator=generator)
        stepped, step = env.step_and_maybe_reset(step.set("action", action.where(action > 3, 3)))
        before, after = stepped["state"], stepped["next", "state"]
        rows = torch.isclose(fast(before, after), slow(before, after), rtol=0, atol=1e-4).all(-1)
        assert rows.double().mean() > 0.98
        ships = target_ships(after)
        assert not ships[~is_present(after)].any()
        assert 0 <= float(ships[..., SHIP_ACTION].sum()) <= ships.shape[0] * ships.shape[1]
        found |= {int(kind) for kind in ships[..., SHIP_CLASS].flatten()}
        turns = ships[..., SHIP_TURN].abs()
        assert bool(turns.any()) <= (name != "1") and turns.sum() <= WORLD.give_way.turn * turns.numel()
    assert found == ({*map(int, Encounter)} if name != "1" else set())
