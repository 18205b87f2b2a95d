"""Target ships that follow recorded paths."""

from __future__ import annotations

import pytest
import torch

from ship_trl import make_env
from ship_trl.sim.cases import Case, RecordedShip, Suite, TargetShip, load_world
from ship_trl.sim.state import SHIP_X, SHIP_Y, target_ships

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


def test_a_path_belongs_to_the_fingerprint() -> None:
    one, other = (
        Case([0, 0], 90, [0, 600], "", [RecordedShip(300, 400, 180, 5, path=p)]) for p in (PATH, PATH[:3])
    )
    assert one.fingerprint != other.fingerprint
