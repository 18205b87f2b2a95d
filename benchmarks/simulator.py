"""Probes of the simulators, a unit being one step of the world and one picture."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray

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
# Takes an action for every environment: int64 [N].
Step = Callable[[NDArray[np.int64]], object]


def probe(group: str, name: str, step: Step, num_envs: int = 1, is_ours: bool = True) -> Probe:
    """Return the probe of a step with random actions, drawn beforehand so that drawing is not timed."""
    num_actions = len(load_world().actions)
    actions = list(np.random.default_rng(0).integers(num_actions, size=(STEPS, num_envs)))

    def run() -> None:
        for action in actions:
            step(action)

    return Probe(group, name, run, STEPS * num_envs, is_ours=is_ours)


def gymnasium_step(env: gymnasium.Env[Any, Any]) -> Step:
    """Return the step of a Gymnasium environment, which begins anew after an episode."""
    env.reset(seed=0)

    def step(action: NDArray[np.int64]) -> None:
        _, _, terminated, truncated, _ = env.step(action[0])
        if terminated or truncated:
            env.reset()

    return step


def vector_step(envs: ShipCollisionVectorEnv) -> Step:
    """Return the step of the vector environment for Gymnasium."""
    envs.reset()
    return envs.step


def torchrl_step(env: ShipEnv) -> Step:
    """Return the step of the TorchRL environment."""
    current = env.reset()

    def step(action: NDArray[np.int64]) -> None:
        nonlocal current
        _, current = env.step_and_maybe_reset(current.set("action", torch.from_numpy(action)))

    return step


def probes() -> list[Probe]:
    """Return pygame and ship_trl's three environments in every case."""
    world, found = load_world(), []
    for name in CASES:
        case, add = load_case(name, world), partial(probe, f"case {name}")
        found += [
            add("Gymnasium and pygame", gymnasium_step(PygameShipEnv(case, world)), is_ours=False),
            add("the same, tuned", gymnasium_step(TunedPygameShipEnv(case, world)), is_ours=False),
            add("ours, Gymnasium", gymnasium_step(ShipCollisionEnv(name))),
        ]
        for n in BATCH_SIZES:
            batched = ShipEnv(case, world, n, from_pixels=True)
            found.append(add(f"ours, vector of {n}", vector_step(ShipCollisionVectorEnv(n, name)), n))
            found.append(add(f"ours, TorchRL of {n}", torchrl_step(batched), n))
    return found
