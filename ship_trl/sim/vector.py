"""The scene as numbers in own ship's frame, for a small fully connected network."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ship_trl.config.types import Network, World
from ship_trl.sim import scene
from ship_trl.sim import state as col
from ship_trl.sim.encounter import Encounter, own_velocity, ship_velocities, turn_since_onset
from ship_trl.sim.geometry import unit_vector
from ship_trl.sim.state import goal_distance, goal_off_bow, is_present, relative_positions, target_ships

# Units of TCPA (s) and DCPA (m), their largest size, and the least relative speed (m/s) that they are for.
TCPA, DCPA, MAX_SIZE, MIN_SPEED = 20.0, 100.0, 2.0, 1e-3
# Units of the time since an encounter began (s), of own turn since then (rad), and of the time left (s).
SINCE, TURNED, LEFT = 20.0, 0.5, 60.0
CLASSES = tuple(Encounter)[1:]

# Maps states [..., S] to numbers [..., F].
Numbers = Callable[[Tensor], Tensor]


class VectorObservation:
    """Observes states as numbers of about one: `observe(state)` maps float [..., S] to float32 [..., F].

    F is 5 + 10 K, or 6 + 19 K with `encounters`, to which the time left belongs. Each number with what 1
    stands for, and its range; the second group once for each of the K nearest target ships, nearest first,
    and all zero where there is none:

        distance of the goal | 640 m | from 0
        sine of the goal's bearing | | -1 to 1, port positive
        cosine of the goal's bearing | | -1 to 1, ahead positive
        own speed | 15 m/s | 0 to 1
        own rate of turn | 0.1 rad/s | -1 to 1, port positive
        time left | 60 s | 0 to 1

        place ahead | 640 m | any, astern negative
        place to port | 640 m | any, starboard negative
        velocity ahead, less own ship's | 15 m/s | any
        velocity to port, less own ship's | 15 m/s | any
        distance | 640 m | from 0
        sine of the bearing | | -1 to 1, port positive
        cosine of the bearing | | -1 to 1, ahead positive
        TCPA | 20 s | -2 to 2, past negative
        DCPA | 100 m | -2 to 2, positive if the bearing turns counter-clockwise
        whether there is a ship | | 0 or 1

    Before the last one, with `encounters`, stand those of the encounter that is locked (`sim.encounter`):

        rate of turn | 0.1 rad/s | any, port positive
        whether own ship meets it head-on | | 0 or 1
        whether own ship gives way to it | | 0 or 1
        whether own ship stands on | | 0 or 1
        whether own ship overtakes it | | 0 or 1
        whether it overtakes own ship | | 0 or 1
        time since the onset | 20 s | from 0
        own turn since the onset | 0.5 rad | -6.3 to 6.3, port positive
        own action since the onset | | 0 to 1

    Speeds and rates of turn are those of the fastest action; for a ship with own ship's velocity TCPA and
    DCPA are 0.

    Args:
        world: speeds and rates of turn of the actions.
        ships: K.
        encounters: whether it observes what has happened since an encounter began.
    """

    def __init__(self, world: World, ships: int, encounters: bool = False) -> None:
        self.ships, self.encounters, self.dt, self.max_steps = ships, encounters, world.dt, world.max_steps
        self.max_speed = max(abs(speed) for speed, _ in world.actions)
        # Above zero in float32 too, where no action turns.
        self.max_turn = max(1e-6, *(abs(turn) for _, turn in world.actions))

    @classmethod
    def of(cls, network: Network, world: World) -> VectorObservation:
        """Return the observation that a network with `linear` layers sees."""
        return cls(world, network.ships, network.encounters)

    def __call__(self, state: Tensor) -> Tensor:
        """Observe states [..., S]; return float32 [..., F]."""
        bearing = goal_off_bow(state)
        own: tuple[Tensor, ...] = (
            goal_distance(state) / scene.VIEW_RADIUS,
            bearing.sin(),
            bearing.cos(),
            state[..., col.SPEED] / self.max_speed,
            state[..., col.YAW_RATE] / self.max_turn,
        )
        if self.encounters:
            own = (*own, ((self.max_steps - state[..., col.STEP]) * self.dt / LEFT).clamp(0.0, 1.0))
        return torch.cat((torch.stack(own, -1), self._observe_ships(state).flatten(-2)), -1)

    def _observe_ships(self, state: Tensor) -> Tensor:
        """Return the numbers of the K nearest target ships [..., K, M]."""
        away, present = relative_positions(state), is_present(state)
        bow = unit_vector(state[..., col.HEADING])[..., None, :]
        velocity = ship_velocities(state) - own_velocity(state)[..., None, :]
        port = torch.stack((-bow[..., 1], bow[..., 0]), -1)
        distance = torch.linalg.vector_norm(away, dim=-1)
        ahead, left = (away * bow).sum(-1), (away * port).sum(-1)
        onward, across = (velocity * bow).sum(-1), (velocity * port).sum(-1)
        speed2 = (onward.square() + across.square()).clamp(min=MIN_SPEED**2)
        numbers = (
            ahead / scene.VIEW_RADIUS,
            left / scene.VIEW_RADIUS,
            onward / self.max_speed,
            across / self.max_speed,
            distance / scene.VIEW_RADIUS,
            left / distance.clamp(min=1e-6),
            ahead / distance.clamp(min=1e-6),
            (-(ahead * onward + left * across) / (speed2 * TCPA)).clamp(-MAX_SIZE, MAX_SIZE),
            ((ahead * across - left * onward) / (speed2.sqrt() * DCPA)).clamp(-MAX_SIZE, MAX_SIZE),
            *(self._observe_encounters(state) if self.encounters else ()),
            torch.ones_like(distance),
        )
        found = torch.stack(numbers, -1) * present[..., None]
        order = distance.masked_fill(~present, torch.inf).argsort(dim=-1, stable=True)[..., : self.ships]
        nearest = found.gather(-2, order[..., None].expand(*order.shape, found.shape[-1]))
        lacking = self.ships - nearest.shape[-2]
        return torch.cat((nearest, state.new_zeros(*state.shape[:-1], lacking, found.shape[-1])), -2)

    def _observe_encounters(self, state: Tensor) -> tuple[Tensor, ...]:
        """Return the numbers of the encounters with the target ships, each [..., K]."""
        ships = target_ships(state)
        kind = ships[..., col.SHIP_CLASS]
        is_on = (kind != Encounter.NONE).to(state.dtype)
        since = state[..., col.STEP, None] - ships[..., col.SHIP_ONSET]
        return (
            ships[..., col.SHIP_TURN] / self.max_turn,
            *((kind == one).to(state.dtype) for one in CLASSES),
            since * self.dt / SINCE * is_on,
            turn_since_onset(state) / TURNED * is_on,
            ships[..., col.SHIP_ACTION],
        )
