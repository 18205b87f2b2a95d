"""The states on which networks are looked at, split by whole episodes, and what is to be read from them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import HEADING, STEP
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.scene import WINDOW
from ship_trl.sim.transition import Transition

# Of an episode; they are some steps apart, for neighbours hardly differ.
STATES_PER_EPISODE = 10
# Steps that an episode is sailed from its shifted start.
LENGTH = 30
# An episode starts anywhere on the way from start to goal but its last part, shifted by up to so many
# metres on each axis, and turned by up to so many radians.
ON_THE_WAY = 0.8
SHIFT, TURN = 300.0, math.pi / 2
# Random actions are held for so many steps, for a ship that turns to and fro goes straight on.
HOLD = 5
# How often an episode of the network takes a random action.
EXPLORE = 0.25
# Shares of the episodes: probes are fitted on the rest, their penalty is chosen on the second.
HELD_OUT, CHECKED = 1 / 3, 1 / 6
# With less of them in view there is nothing to judge a probe by.
LEAST_EPISODES = 5
MOST_BATCHES = 20

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Quantity:
    """What a probe is asked for: `values` [N, D] of a `thing`; only states with `seen` [N] count.

    A bearing is (sin, cos) of the angle from own ship's bow; a distance is in metres.
    """

    thing: str
    kind: str
    values: Floats
    seen: Bools

    @property
    def name(self) -> str:
        """Name for people."""
        return f"{self.kind} of {self.thing}"


@dataclass(frozen=True)
class StateSet:
    """N states of a case: `states` float [N, 4], `pixels` uint8 [N, C, 84, 84], `episode` int [N].

    `held_out` [N] are of episodes that no probe is fitted on, `checked` [N] of those that choose its
    penalty; `random` [N] were sailed by random actions, the others by the network that is explained.
    """

    states: Tensor
    pixels: Tensor
    episode: NDArray[np.int64]
    held_out: Bools
    checked: Bools
    random: Bools
    quantities: tuple[Quantity, ...]

    @property
    def fitted(self) -> Bools:
        """States that a probe is fitted on while its penalty is chosen."""
        return ~(self.held_out | self.checked)


def draw_states(
    case: Case,
    world: World,
    draw: Rasteriser,
    best: Callable[[Tensor], Tensor],
    episodes: int,
    generator: Generator,
) -> StateSet:
    """Sail episodes from around the way to the goal, half of them at random, and take some states of each.

    Args:
        case: where.
        world: its physics.
        draw: states to pixels.
        best: pixels [N, C, 84, 84] to the actions of the network that is explained, int64 [N].
        episodes: how many.
        generator: of all draws, on the CPU.

    Raises:
        ConfigError: too few episodes can be sailed in this case from where they start.
    """
    rows: list[Tensor] = []
    kinds: list[bool] = []
    for _ in range(MOST_BATCHES):
        for states, kind in sail(case, world, draw, best, episodes, generator):
            picked = torch.randperm(len(states), generator=generator)[:STATES_PER_EPISODE].sort().values
            rows.append(states[picked])
            kinds.append(kind)
        if len(rows) >= episodes:
            break
    else:
        shortest = f"ends before {STATES_PER_EPISODE} steps"
        raise ConfigError(f"target: case {case.name} cannot be looked at: nearly every episode {shortest}")
    states = torch.cat(rows[:episodes])
    order = torch.randperm(episodes, generator=generator).numpy()
    held, checked = np.zeros((2, episodes), dtype=bool)
    first, second = round(episodes * HELD_OUT), round(episodes * (HELD_OUT + CHECKED))
    held[order[:first]], checked[order[first:second]] = True, True
    episode = np.repeat(np.arange(episodes), STATES_PER_EPISODE)
    found = StateSet(
        states,
        draw(states),
        episode,
        held[episode],
        checked[episode],
        np.array(kinds[:episodes])[episode],
        tuple(quantities(case, world, states)),
    )
    kept = tuple(q for q in found.quantities if enough(q, found))
    return StateSet(**{**vars(found), "quantities": kept})


def sail(
    case: Case,
    world: World,
    draw: Rasteriser,
    best: Callable[[Tensor], Tensor],
    count: int,
    generator: Generator,
) -> list[tuple[Tensor, bool]]:
    """Sail `count` episodes at once; returns the states of each that is long enough, and if it is random."""
    motion = Transition(case, world, torch.device("cpu"))
    along = ON_THE_WAY * torch.rand(count, 1, generator=generator)
    shift = 2.0 * torch.rand(count, 3, generator=generator) - 1.0
    state = motion.start.repeat(count, 1)
    state[:, :2] += along * (motion.goal - motion.start[:2]) + SHIFT * shift[:, :2]
    state[:, HEADING] += TURN * shift[:, 2]
    latest = max(0, world.max_steps - LENGTH)
    state[:, STEP] = torch.randint(latest + 1, (count,), generator=generator).float()
    random = torch.arange(count) % 2 == 0
    apart = torch.linalg.vector_norm(motion.away(state), dim=-1)
    sailing = (apart > world.safe_distance).all(-1) & (motion.goal_distance(state) > world.goal_distance)
    held = torch.zeros(count, dtype=torch.int64)
    states, valid = [], []
    for time in range(LENGTH):
        states.append(state)
        valid.append(sailing)
        drawn = torch.randint(len(world.actions), (count,), generator=generator)
        held = drawn if time % HOLD == 0 else held
        explore = torch.rand(count, generator=generator) < EXPLORE
        action = torch.where(random, held, torch.where(explore, drawn, best(draw(state))))
        after = motion(state, action)
        sailing = sailing & ~(after.goal | after.collision | after.truncated)
        state = after.state
    sailed, lasted = torch.stack(states, 1), torch.stack(valid, 1)
    return [
        (row[alive], bool(kind))
        for row, alive, kind in zip(sailed, lasted, random, strict=True)
        if int(alive.sum()) >= STATES_PER_EPISODE
    ]


def quantities(case: Case, world: World, states: Tensor) -> list[Quantity]:
    """Measure bearing and distance of the goal and of each target ship.

    The bearing of the goal can always be seen, for a line leads there; a distance, or a ship, only inside
    the picture.
    """
    motion = Transition(case, world, torch.device("cpu"))
    ships = states[:, None, :2] + motion.away(states)
    names = ["the goal", *(f"ship {k + 1}" for k in range(ships.shape[1]))]
    if ships.shape[1] == 1:
        names[1] = "the ship"
    points = [motion.goal.expand(len(states), 2), *ships.unbind(1)]
    found = []
    for name, point in zip(names, points, strict=True):
        angle = angle_off_bow(states[:, :2], states[:, HEADING], point).double()
        distance = torch.linalg.vector_norm(point - states[:, :2], dim=-1).double()
        inside = (distance <= WINDOW).numpy()
        always = np.ones_like(inside) if name == "the goal" else inside
        bearing = torch.stack((angle.sin(), angle.cos()), 1).numpy()
        found += [
            Quantity(name, "bearing", bearing, always),
            Quantity(name, "distance", distance[:, None].numpy(), inside),
        ]
    return found


def enough(quantity: Quantity, drawn: StateSet) -> bool:
    """Whether a quantity is seen in enough episodes of each part of the states."""
    parts = (drawn.held_out, drawn.checked, drawn.fitted)
    return all(len(set(drawn.episode[part & quantity.seen])) >= LEAST_EPISODES for part in parts)
