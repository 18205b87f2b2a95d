"""Probes of the simulators, a unit being one step of the world and one picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator

from benchmarks.ours import CASE
from benchmarks.pygame_env import PygameShipEnv, TunedPygameShipEnv
from benchmarks.timing import Probe
from ship_trl.fast.worlds import make_env, make_starts
from ship_trl.gym import ShipCollisionEnv, ShipCollisionVectorEnv
from ship_trl.sim.cases import Case, load_case, load_suite, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.state import first_case

CASES = ("1", "2", "4")
BATCH_SIZES, GPU_SIZES = (1, 16, 64, 1024), (1, 64, 4096, 65536)
# On random encounters; scenes that pygame takes in turn.
TRAFFIC_SIZES, SCENES = (64,), 1000
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


def draw_cases(count: int) -> list[Case]:
    """Return cases drawn from suite `traffic_near`."""
    world = load_world()
    suite = load_suite("traffic_near", world)
    states = make_starts(suite, world).sample(count, Generator().manual_seed(0))
    return [first_case(suite, state) for state in states]


def group(title: str, name: str, cases: Sequence[Case], sizes: Sequence[int]) -> list[Probe]:
    """Return pygame on `cases`, and ship_trl's three environments on the case or suite of a name."""
    world, add = load_world(), partial(probe, title)
    found = [
        add("Gymnasium and pygame", gymnasium_step(PygameShipEnv(cases, world)), is_ours=False),
        add("the same, tuned", gymnasium_step(TunedPygameShipEnv(cases, world)), is_ours=False),
        add("ours, Gymnasium", gymnasium_step(ShipCollisionEnv(name))),
    ]
    for n in sizes:
        batched = make_env(load_suite(name, world), world, n, from_pixels=True)
        found.append(add(f"ours, vector of {n}", vector_step(ShipCollisionVectorEnv(n, name)), n))
        found.append(add(f"ours, TorchRL of {n}", torchrl_step(batched), n))
    return found


def gpu_probes(device: str) -> list[Probe]:
    """Return steps of environments that draw on a GPU, by their number, with and without CUDA graphs."""
    world, found = load_world(), []
    for count in GPU_SIZES:
        for fast, name in ((True, "ours"), (False, "ours, operation by operation")):
            case = load_case(CASE, world)
            env = make_env(case, world, count, from_pixels=True, device=device, fast=fast)
            action = torch.randint(len(world.actions), (count,)).to(device)

            def run(env: ShipEnv = env, action: torch.Tensor = action) -> None:
                current = env.reset()
                for _ in range(STEPS):
                    _, current = env.step_and_maybe_reset(current.set("action", action))

            found.append(Probe(f"{count} ships", name, run, STEPS * count, is_ours=True))
    return found


def probes(device: str = "cpu") -> list[Probe]:
    """Return the groups of the cases, and that of random encounters; on a GPU, ours alone.

    pygame's scenes are drawn beforehand: drawing is timed in ship_trl's environments alone.
    """
    if device != "cpu":
        return gpu_probes(device)
    world, found = load_world(), []
    for name in CASES:
        found += group(f"case {name}", name, [load_case(name, world)], BATCH_SIZES)
    return found + group("traffic", "traffic", draw_cases(SCENES), TRAFFIC_SIZES)
