"""Probes of the simulators, a unit being one step of the world and one picture."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import torch

from benchmarks.pygame_env import PygameShipEnv, TunedPygameShipEnv
from benchmarks.timing import Probe
from ship_trl.gym.env import ShipCollisionEnv
from ship_trl.gym.vector import ShipCollisionVectorEnv
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.env import ShipEnv

CASES = ("1", "2", "4")
BATCH_SIZES = (1, 16, 64, 1024)
# Of one environment in one call of a probe.
STEPS = 16


def draw_actions(num_envs: int) -> Any:
    """Return random actions, drawn beforehand so that drawing is not timed: int64 [STEPS, num_envs]."""
    return np.random.default_rng(0).integers(len(load_world().actions), size=(STEPS, num_envs))


def step_one(env: gymnasium.Env[Any, Any]) -> Callable[[], None]:
    """Return a function that takes random actions in a Gymnasium environment."""
    actions = list(draw_actions(1)[:, 0])
    env.reset(seed=0)

    def run() -> None:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return run


def step_vector(envs: ShipCollisionVectorEnv) -> Callable[[], None]:
    """Return a function that takes random actions in the vector environment for Gymnasium."""
    actions = draw_actions(envs.num_envs)
    envs.reset()

    def run() -> None:
        for action in actions:
            envs.step(action)

    return run


def step_torchrl(env: ShipEnv) -> Callable[[], None]:
    """Return a function that takes random actions in the TorchRL environment."""
    actions = torch.from_numpy(draw_actions(env.batch_size[0]))
    current = env.reset()

    def run() -> None:
        nonlocal current
        for action in actions:
            _, current = env.step_and_maybe_reset(current.set("action", action))

    return run


def probes() -> list[Probe]:
    """Return pygame and ship_trl's three environments in every case."""
    world, found = load_world(), []
    for name in CASES:
        case = load_case(name, world)
        peer, ours = partial(Probe, f"case {name}"), partial(Probe, f"case {name}", is_ours=True)
        found += [
            peer("Gymnasium and pygame", step_one(PygameShipEnv(case, world)), STEPS),
            peer("the same, tuned", step_one(TunedPygameShipEnv(case, world)), STEPS),
            ours("ours, Gymnasium", step_one(ShipCollisionEnv(name)), STEPS),
        ]
        for n in BATCH_SIZES:
            found += [
                ours(f"ours, vector of {n}", step_vector(ShipCollisionVectorEnv(n, name)), n * STEPS),
                ours(
                    f"ours, TorchRL of {n}",
                    step_torchrl(ShipEnv(case, world, n, from_pixels=True)),
                    n * STEPS,
                ),
            ]
    return found
