"""Target ships that follow recorded paths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from ship_trl import make_env
from ship_trl.gym import ShipCollisionEnv
from ship_trl.learn.rollout import rollout
from ship_trl.policies.planner import best_plan
from ship_trl.policies.reference import follow_plan, keep_course
from ship_trl.sim.cases import Case, RecordedShip, Suite, TargetShip, load_world, suite_of
from ship_trl.sim.state import SHIP_X, SHIP_Y, target_ships
from ship_trl.view.episode import Telemetry

WORLD = load_world()
PATH = tuple((300.0 - 5 * step, 400.0 + (step > 5) * 3 * (step - 5)) for step in range(1, 21))


def states(*ships: TargetShip, fast: bool = True) -> torch.Tensor:
    cases = tuple(Case([0, 0], 90, [0, 600], "", [ship], f"c{n}") for n, ship in enumerate(ships))
    env = make_env(Suite("s", cases), WORLD, len(cases), fast=fast, starts=None)
    straight = torch.full((len(cases),), WORLD.straight_action)
    found = env.reset()
    rows = [found["state"]]
    for _ in range(25):
        found = env.step(found.set("action", straight))["next"]
        rows.append(found["state"])
    return torch.stack(rows)


@pytest.mark.parametrize("fast", [True, False])
def test_a_recorded_ship_is_where_its_path_says_and_then_keeps_its_course(fast: bool) -> None:
    ship = RecordedShip(300, 400, 180, 5, path=PATH)
    places = target_ships(states(ship, fast=fast))[:, 0, 0, SHIP_X : SHIP_Y + 1]
    torch.testing.assert_close(places[1:21], torch.tensor(PATH), rtol=0, atol=1e-2)
    torch.testing.assert_close(places[25] - places[21], 4 * (places[20] - places[19]), rtol=0, atol=1e-2)


def test_ships_of_a_suite_follow_their_own_paths() -> None:
    other = tuple((x + 50, y) for x, y in PATH)
    ships = RecordedShip(300, 400, 180, 5, path=PATH), RecordedShip(350, 400, 180, 5, path=other, number=1)
    rows = states(*ships)
    for row in rows.unbind(1):
        path = PATH if float(target_ships(row)[0, 0, SHIP_X]) == 300 else other
        places = target_ships(row)[1:21, 0, SHIP_X : SHIP_Y + 1]
        torch.testing.assert_close(places, torch.tensor(path), rtol=0, atol=1e-2)


def test_gymnasium_planner_and_pictures_move_recorded_ships_likewise(monkeypatch: pytest.MonkeyPatch) -> None:
    # On its course the ship passes far ahead; on its path it meets own ship. The search is short.
    world = replace(WORLD, max_steps=36)
    path = tuple((200.0 - 10 * step, 150.0 + 5 * step) for step in range(1, 31))
    ship = RecordedShip(200, 150, 0, 15, path=path)
    suite = suite_of(Case([0, 0], 90, [0, 400], "", [ship], "c"))
    monkeypatch.setattr("ship_trl.gym.load_changed", lambda *_: (suite, world))
    own = ShipCollisionEnv()
    own.reset()
    *_, info = next(found for _ in range(36) if (found := own.step(np.int64(world.straight_action)))[2])
    assert info["collision"]
    straight = [world.straight_action] * 36
    plan, best = follow_plan(suite.case, world, straight), best_plan(suite.case, world, beam=100)
    assert not plan.goal and best.goal
    (episode,) = rollout(env := make_env(suite, world), keep_course(env))
    assert episode.collision and Telemetry(world, episode.states, episode.actions).outcome == "collision"
    assert follow_plan(suite.case, world, best.actions) == best


def test_a_ship_without_a_path_keeps_its_course() -> None:
    places = target_ships(states(RecordedShip(300, 400, 0, 5)))[:, 0, 0, SHIP_X]
    assert float(places[20]) == pytest.approx(400, abs=1e-2)


def test_a_path_belongs_to_the_fingerprint() -> None:
    one, other = (
        Case([0, 0], 90, [0, 600], "", [RecordedShip(300, 400, 180, 5, path=p)]) for p in (PATH, PATH[:3])
    )
    assert one.fingerprint != other.fingerprint
