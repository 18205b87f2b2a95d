"""The states on which networks are measured, split by episode, and the quantities that probes read."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.explain.saliency import greedy_actions
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim import state as col
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.replay import with_replay
from ship_trl.sim.scene import VIEW_RADIUS
from ship_trl.sim.state import goal, goal_distance, initial_state, position, relative_positions, target_ships
from ship_trl.sim.transition import Transition

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Only some states of an episode are taken, because neighbouring states hardly differ.
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
HELD_OUT, VALIDATION = 1 / 3, 1 / 6
# A quantity must be visible in this many episodes of each part.
MIN_EPISODES = 5
MAX_BATCHES = 20


@dataclass(frozen=True)
class Quantity:
    """Labels of a probe: `values` [N, D], which count only in the states that are `visible` [N].

    A bearing is (sin, cos) of the angle off the bow, a distance is in metres.
    """

    name: str
    values: Floats
    visible: Bools


@dataclass(frozen=True)
class StateSet:
    """N states of a case: `states` float [N, 4], `pixels` uint8 [N, C, 84, 84], `episode` int [N].

    `held_out` [N] marks test episodes, `validation` [N] those that choose a probe's penalty.
    """

    states: Tensor
    pixels: Tensor
    episode: Ints
    held_out: Bools
    validation: Bools
    quantities: list[Quantity]

    @property
    def training(self) -> Bools:
        """States of the episodes that probes are fitted on."""
        return ~(self.held_out | self.validation)


def draw_states(env: ShipEnv, network: DuelingNetwork, episodes: int, generator: Generator) -> StateSet:
    """Take some states of each of many episodes; half of the episodes take random actions.

    Quantities that are rarely visible are left out.

    Raises:
        ConfigError: nearly all episodes end too early.
    """
    rows: list[Tensor] = []
    for _ in range(MAX_BATCHES):
        for running in run_episodes(env, network, episodes, generator):
            picked = torch.randperm(len(running), generator=generator)[:STATES_PER_EPISODE].sort().values
            rows.append(running[picked])
        if len(rows) >= episodes:
            break
    else:
        raise ConfigError(
            f"target: too few states of case {env.case.name}: nearly every episode ends before "
            f"{STATES_PER_EPISODE} steps"
        )
    states = torch.cat(rows[:episodes])
    episode = np.repeat(np.arange(episodes), STATES_PER_EPISODE)
    # The place of each state's episode in a random order.
    place = torch.randperm(episodes, generator=generator).argsort().numpy()[episode]
    held_out = place < round(episodes * HELD_OUT)
    validation = ~held_out & (place < round(episodes * (HELD_OUT + VALIDATION)))
    parts = (held_out, validation, ~(held_out | validation))
    quantities = [
        quantity
        for quantity in measure_quantities(states)
        if all(len(set(episode[part & quantity.visible])) >= MIN_EPISODES for part in parts)
    ]
    return StateSet(states, env.rasteriser(states), episode, held_out, validation, quantities)


def run_episodes(env: ShipEnv, network: DuelingNetwork, count: int, generator: Generator) -> list[Tensor]:
    """Run `count` episodes in a batch, half of them at random; return the states of the long ones."""
    world = env.world
    motion, start = with_replay(Transition(world), env.suite, world), initial_state(env.case, world)
    along = START_SHARE * torch.rand(count, 1, generator=generator)
    shift = 2.0 * torch.rand(count, 3, generator=generator) - 1.0
    state = start.repeat(count, 1)
    position(state).add_(along * (goal(start) - position(start)) + MAX_SHIFT * shift[:, :2])
    state[:, col.HEADING] += MAX_TURN * shift[:, 2]
    latest = max(0, world.max_steps - EPISODE_STEPS)
    state[:, col.STEP] = torch.randint(latest + 1, (count,), generator=generator).float()
    is_random = torch.arange(count) % 2 == 0
    clearance = torch.linalg.vector_norm(relative_positions(state), dim=-1)
    running = (clearance > world.safe_distance).all(-1) & (goal_distance(state) > world.goal_distance)
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


def measure_quantities(states: Tensor) -> list[Quantity]:
    """Measure bearing and distance of the goal and of each target ship.

    They are visible inside the picture; the line to the goal shows its bearing everywhere.
    """
    ships = target_ships(states)[..., :2]
    points = {"the goal": goal(states)}
    points |= {f"ship {k}": ship for k, ship in enumerate(ships.unbind(1), 1)}
    found = []
    for name, point in points.items():
        angle = angle_off_bow(position(states), states[:, col.HEADING], point).double()
        distance = torch.linalg.vector_norm(point - position(states), dim=-1).double()
        inside = (distance <= VIEW_RADIUS).numpy()
        always = np.ones_like(inside) if name == "the goal" else inside
        bearing = torch.stack((angle.sin(), angle.cos()), 1).numpy()
        found += [
            Quantity(f"bearing of {name}", bearing, always),
            Quantity(f"distance of {name}", distance[:, None].numpy(), inside),
        ]
    return found
