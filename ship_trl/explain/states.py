"""The states on which networks are measured, split by episode, and the quantities that probes read."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.explain.bootstrap import Bools, Floats, Ints
from ship_trl.explain.saliency import greedy_actions
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.dynamics import HEADING, STEP
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.scene import VIEW_RADIUS
from ship_trl.sim.transition import Transition

# Neighbouring states hardly differ, so only some of an episode are taken.
STATES_PER_EPISODE = 10
EPISODE_STEPS = 30
# Episodes start on the first part of the straight line from start to goal, then shifted by up to
# `MAX_SHIFT` metres on each axis and turned by up to `MAX_TURN` radians.
START_SHARE = 0.8
MAX_SHIFT, MAX_TURN = 300.0, math.pi / 2
# Random actions are held for some steps: a ship that alternates between port and starboard goes straight on.
HOLD_STEPS = 5
# Share of random actions in episodes of the network.
EXPLORATION = 0.25
# Shares of the episodes; probes are fitted on the rest.
HELD_OUT, CHECKED = 1 / 3, 1 / 6
# A quantity needs this many episodes in each part.
MIN_EPISODES = 5
MAX_BATCHES = 20


@dataclass(frozen=True)
class Quantity:
    """Labels of a probe: `values` [N, D]; only states in which `visible` [N] count.

    A bearing is (sin, cos) of the angle off the bow, a distance is in metres.
    """

    thing: str
    kind: str
    values: Floats
    visible: Bools

    @property
    def name(self) -> str:
        """What figures and tables call it."""
        return f"{self.kind} of {self.thing}"


@dataclass(frozen=True)
class StateSet:
    """N states of a case: `states` float [N, 4], `pixels` uint8 [N, C, 84, 84], `episode` int [N].

    `held_out` [N] marks test episodes, `checked` [N] validation episodes, which choose a probe's penalty.
    """

    states: Tensor
    pixels: Tensor
    episode: Ints
    held_out: Bools
    checked: Bools
    quantities: tuple[Quantity, ...]

    @property
    def fitted(self) -> Bools:
        """States of the training episodes of probes."""
        return ~(self.held_out | self.checked)

    def has_enough(self, quantity: Quantity) -> bool:
        """Whether a quantity is visible in enough episodes of each part."""
        parts = (self.held_out, self.checked, self.fitted)
        return all(len(set(self.episode[part & quantity.visible])) >= MIN_EPISODES for part in parts)


def draw_states(env: ShipEnv, network: DuelingNetwork, episodes: int, generator: Generator) -> StateSet:
    """Run episodes from around the line to the goal, half of them at random, and take some states of each.

    Args:
        env: gives case, world and pictures.
        network: acts in the other half.
        episodes: how many episodes.
        generator: of all draws, on the CPU.

    Raises:
        ConfigError: nearly all episodes end too early.
    """
    rows: list[Tensor] = []
    for _ in range(MAX_BATCHES):
        for states in run_episodes(env, network, episodes, generator):
            picked = torch.randperm(len(states), generator=generator)[:STATES_PER_EPISODE].sort().values
            rows.append(states[picked])
        if len(rows) >= episodes:
            break
    else:
        raise ConfigError(
            f"target: too few states of case {env.case.name}: nearly every episode ends before "
            f"{STATES_PER_EPISODE} steps"
        )
    states = torch.cat(rows[:episodes])
    order = torch.randperm(episodes, generator=generator).numpy()
    held_out, checked = np.zeros((2, episodes), dtype=bool)
    first, second = round(episodes * HELD_OUT), round(episodes * (HELD_OUT + CHECKED))
    held_out[order[:first]], checked[order[first:second]] = True, True
    episode = np.repeat(np.arange(episodes), STATES_PER_EPISODE)
    found = StateSet(
        states,
        env.rasteriser(states),
        episode,
        held_out[episode],
        checked[episode],
        tuple(measure_quantities(env, states)),
    )
    return dataclasses.replace(found, quantities=tuple(filter(found.has_enough, found.quantities)))


def run_episodes(env: ShipEnv, network: DuelingNetwork, count: int, generator: Generator) -> list[Tensor]:
    """Run `count` episodes side by side, every other one at random; return the states of the long ones."""
    world = env.world
    motion = Transition(env.case, world, torch.device("cpu"))
    along = START_SHARE * torch.rand(count, 1, generator=generator)
    shift = 2.0 * torch.rand(count, 3, generator=generator) - 1.0
    state = motion.start.repeat(count, 1)
    state[:, :2] += along * (motion.goal - motion.start[:2]) + MAX_SHIFT * shift[:, :2]
    state[:, HEADING] += MAX_TURN * shift[:, 2]
    latest = max(0, world.max_steps - EPISODE_STEPS)
    state[:, STEP] = torch.randint(latest + 1, (count,), generator=generator).float()
    is_random = torch.arange(count) % 2 == 0
    clearance = torch.linalg.vector_norm(motion.relative_positions(state), dim=-1)
    running = (clearance > world.safe_distance).all(-1) & (motion.goal_distance(state) > world.goal_distance)
    held = torch.zeros(count, dtype=torch.int64)
    states, valid = [], []
    for step in range(EPISODE_STEPS):
        states.append(state)
        valid.append(running)
        drawn = torch.randint(len(world.actions), (count,), generator=generator)
        held = drawn if step % HOLD_STEPS == 0 else held
        explore = torch.rand(count, generator=generator) < EXPLORATION
        greedy = greedy_actions(network, env.rasteriser(state))
        action = torch.where(is_random, held, torch.where(explore, drawn, greedy))
        after = motion(state, action)
        running = running & ~(after.goal | after.collision | after.truncated)
        state = after.state
    found = zip(torch.stack(states, 1), torch.stack(valid, 1), strict=True)
    return [row[alive] for row, alive in found if int(alive.sum()) >= STATES_PER_EPISODE]


def measure_quantities(env: ShipEnv, states: Tensor) -> list[Quantity]:
    """Measure bearing and distance of the goal and of each target ship.

    The bearing of the goal is always visible, as a line leads there. Ships and distances are visible only
    inside the picture.
    """
    motion = Transition(env.case, env.world, torch.device("cpu"))
    ships = states[:, None, :2] + motion.relative_positions(states)
    count = ships.shape[1]
    names = ["the goal", *("the ship" if count == 1 else f"ship {k + 1}" for k in range(count))]
    points = [motion.goal.expand(len(states), 2), *ships.unbind(1)]
    found = []
    for name, point in zip(names, points, strict=True):
        angle = angle_off_bow(states[:, :2], states[:, HEADING], point).double()
        distance = torch.linalg.vector_norm(point - states[:, :2], dim=-1).double()
        inside = (distance <= VIEW_RADIUS).numpy()
        always = np.ones_like(inside) if name == "the goal" else inside
        bearing = torch.stack((angle.sin(), angle.cos()), 1).numpy()
        found += [
            Quantity(name, "bearing", bearing, always),
            Quantity(name, "distance", distance[:, None].numpy(), inside),
        ]
    return found
