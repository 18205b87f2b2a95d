"""Probes of the simulators: one world step and one picture is a unit."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import Generator

from ship_trl.bench.pygame_env import PygameShipEnv, TunedPygameShipEnv
from ship_trl.bench.timing import Probe, measure
from ship_trl.bench.work import CHUNK
from ship_trl.config.types import World
from ship_trl.gym.env import ShipCollisionEnv
from ship_trl.gym.vector import ShipCollisionVectorEnv
from ship_trl.sim.cases import MAX_TARGET_SHIPS, Case, TargetShip, load_case, load_world
from ship_trl.sim.env import ShipEnv

CASES = ("1", "2", "4")
BATCHES = (1, 16, 64, 1024)
MakeEnv = Callable[[], gymnasium.Env[Any, Any]]


def one_by_one(env: gymnasium.Env[Any, Any]) -> Callable[[], int]:
    """Random actions in a Gymnasium environment, `CHUNK` steps a call."""
    actions = random_actions(7)
    env.reset(seed=0)

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return len(actions)

    return run


def random_actions(count: int) -> list[np.int64]:
    """Draw the same random actions every time, beforehand."""
    return list(np.random.default_rng(0).integers(count, size=CHUNK))


def batched(case: Case, world: World, num_envs: int) -> Callable[[], int]:
    """Random actions in our batched environment with pixels; at least `CHUNK` steps a call."""
    env = ShipEnv(case, world, num_envs, from_pixels=True)
    calls = max(1, CHUNK // num_envs)
    shape = (calls, num_envs)
    actions = torch.randint(len(world.actions), shape, generator=Generator().manual_seed(0))
    current = env.reset()

    def run() -> int:
        nonlocal current
        for action in actions:
            _, current = env.step_and_maybe_reset(current.set("action", action))
        return calls * num_envs

    return run


def vector(case: str, count: int) -> Callable[[], int]:
    """Random actions in our vector environment for Gymnasium; at least `CHUNK` steps a call."""
    envs = ShipCollisionVectorEnv(count, case)
    calls = max(1, CHUNK // count)
    actions = np.random.default_rng(0).integers(len(load_world().actions), size=(calls, count))
    envs.reset()

    def run() -> int:
        for action in actions:
            envs.step(action)
        return calls * count

    return run


def simulator_probes() -> list[Probe]:
    """Each case: pygame, our Gymnasium environment, and our batched one."""
    world, probes = load_world(), []
    for name in CASES:
        case, group = load_case(name, world), f"case {name}"
        probes += [
            Probe("Gymnasium and pygame", one_by_one(PygameShipEnv(case, world)), group=group),
            Probe("the same, tuned", one_by_one(TunedPygameShipEnv(case, world)), group=group),
            *(
                Probe(f"ours, vector of {batch}", vector(name, batch), group=group, ours=True)
                for batch in BATCHES
            ),
            *(
                Probe(f"ours, TorchRL of {batch}", batched(case, world, batch), group=group, ours=True)
                for batch in BATCHES
            ),
            Probe("ours, Gymnasium", one_by_one(ShipCollisionEnv(name)), group=group, ours=True),
        ]
    return probes


def fleet(case: Case, ships: int) -> Case:
    """Make a case with so many target ships, spread over the picture and on courses that differ."""
    places = [math.tau * k / MAX_TARGET_SHIPS for k in range(ships)]
    return dataclasses.replace(
        case,
        name=f"{ships} ships",
        target_ships=[
            # 400 m off, passing on the outside.
            TargetShip(400 * math.cos(place), 400 * math.sin(place), math.degrees(place) + 90, 5.0)
            for place in places
        ],
    )


def ship_probes() -> list[Probe]:
    """How simulation and drawing grow with the number of target ships."""
    world, probes = load_world(), []
    base = load_case("1", world)
    for ships in range(0, MAX_TARGET_SHIPS + 1, 2):
        case, group = fleet(base, ships), f"{ships} target ships"
        probes += [
            Probe("Gymnasium and pygame", one_by_one(PygameShipEnv(case, world)), group=group),
            Probe("ours, batch of 64", batched(case, world, 64), group=group, ours=True),
        ]
    return probes


def faster_env(case_name: str, reward_scale: float, seconds: float = 0.2) -> tuple[MakeEnv, str]:
    """Return the quicker of the two Gymnasium environments, tried here and now, and a sentence on it."""
    world = load_world()
    case = load_case(case_name, world)
    makers: dict[str, MakeEnv] = {
        "the tuned pygame environment": lambda: TunedPygameShipEnv(case, world, reward_scale),
        "our Gymnasium environment": lambda: ShipCollisionEnv(case_name, reward_scale=reward_scale),
    }
    probes = [Probe(name, one_by_one(make())) for name, make in makers.items()]
    timings = sorted(measure(probes, rounds=3, seconds=seconds), key=lambda t: -t.rate)
    first, second = timings
    said = (
        f"Peers learn on {first.probe.name}: {first.rate:,.0f} steps/s, {second.probe.name} "
        f"{second.rate:,.0f} (case {case_name})."
    )
    return makers[first.probe.name], said
