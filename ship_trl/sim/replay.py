"""Target ships that follow a recorded path instead of holding course: the replay of real traffic."""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.cases import FIRST_RECORDED, RecordedShip, Suite
from ship_trl.sim.state import SHIP_BEHAVIOUR, SHIP_HEADING, SHIP_SPEED, STEP, target_ships
from ship_trl.sim.transition import Outcome, Step


def with_replay(step: Step, suite: Suite, world: World, device: torch.device | str = "cpu") -> Step:
    """Return the step of a suite: the same, unless a case has recorded ships."""
    ships = [ship for case in suite.cases for ship in case.target_ships if isinstance(ship, RecordedShip)]
    return Replay(step, ships, world.dt, device) if ships else step


def as_moved(before: Tensor, after: Tensor) -> Tensor:
    """Return states `before` a step, with recorded ships heading as they do in the states `after` it."""
    before = before.clone()
    ships, moved = target_ships(before), target_ships(after)
    follows = ships[..., SHIP_BEHAVIOUR, None] >= FIRST_RECORDED
    motion = [SHIP_HEADING, SHIP_SPEED]
    ships[..., motion] = torch.where(follows, moved[..., motion], ships[..., motion])
    return before


class Replay:
    """A simulation step before which each recorded ship heads for its next recorded place.

    A ship's behaviour in a state is its number in the suite, so the step stays a function of states and
    actions. After the end of its path a ship keeps course and speed.
    """

    def __init__(self, step: Step, ships: list[RecordedShip], dt: float, device: torch.device | str) -> None:
        self.step, self.dt = step, dt
        longest = max(len(ship.path) for ship in ships)
        # Places [M, T, 2] after each step, by the ship's number; NaN after the end of a path.
        most = 1 + max(ship.number for ship in ships)
        # One place more, beyond the end of all paths.
        self.paths = torch.full((most, longest + 1, 2), torch.nan)
        for ship in ships:
            self.paths[ship.number, : len(ship.path)] = torch.tensor(ship.path).reshape(-1, 2)
        self.paths = self.paths.to(device)

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """Return the outcome of an action in states [N, S]; see `ship_trl.sim.transition.Transition`."""
        return self.step(self.turn(state), action)

    def turn(self, state: Tensor) -> Tensor:
        """Return states [N, S] in which recorded ships head for their next places."""
        state = state.clone()
        ships = target_ships(state)
        number = ships[..., SHIP_BEHAVIOUR].long() - FIRST_RECORDED
        time = state[:, None, STEP].long().clamp(max=self.paths.shape[1] - 1)
        east, north = (self.paths[number.clamp(min=0), time] - ships[..., :2]).unbind(-1)
        follows = (number >= 0) & east.isfinite()
        ships[..., SHIP_HEADING] = torch.where(follows, torch.atan2(north, east), ships[..., SHIP_HEADING])
        ships[..., SHIP_SPEED] = torch.where(
            follows, torch.hypot(east, north) / self.dt, ships[..., SHIP_SPEED]
        )
        return state
