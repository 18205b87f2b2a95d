"""Worlds and learning that compiled loops compute on a CPU, and CUDA graphs on a GPU."""

from __future__ import annotations

from typing import Any, cast

import torch
from torch import Generator, Tensor

from ship_trl.config.network import supports_incremental
from ship_trl.config.types import World
from ship_trl.fast.graphs import Captured
from ship_trl.learn.algorithm import Accelerator
from ship_trl.learn.network import Backend, Draw, DuelingNetwork
from ship_trl.sim.cases import Case, Suite
from ship_trl.sim.encounter import Track, Tracker
from ship_trl.sim.env import Engine, ShipEnv
from ship_trl.sim.render import Drawing, Rasteriser
from ship_trl.sim.starts import Starts, TrafficStarts
from ship_trl.sim.starts import make_starts as make_plain_starts
from ship_trl.sim.state import OWN_SIZE
from ship_trl.sim.transition import Outcome, Step, Transition
from ship_trl.sim.vector import Numbers, VectorObservation

# Loops are imported where they are needed: numba takes half a second, and a GPU needs none.
# Added to the seed of the starts, whose random numbers must not be those of a policy.
STARTS_SEED = 1_000_003


class Slow(Engine):
    """Torch steps and draws. Random encounters, the same in all worlds, take milliseconds each in Python."""

    def scenes(self, *arguments: Any) -> bool:
        """Draw random encounters by a compiled loop."""
        from ship_trl.fast import step

        return bool(step.draw_scenes(*arguments))


class Fast(Slow):
    """Compiled loops, or CUDA graphs on a GPU."""

    def step(self, transition: Transition) -> Step:
        """Make the simulation step."""
        kind = transition.actions.device.type
        if kind != "cpu":
            return Captured(transition) if kind == "cuda" else transition
        from ship_trl.fast.step import CompiledStep

        return CompiledStep(transition)

    def tracker(self, tracker: Tracker) -> Track:
        """Make what writes into states what has happened."""
        if tracker.device.type != "cpu":
            return Captured(tracker) if tracker.device.type == "cuda" else tracker
        from ship_trl.fast.track import CompiledTracker

        return CompiledTracker(tracker)

    def numbers(self, observation: VectorObservation, device: torch.device) -> Numbers:
        """Make what observes states as numbers."""
        if device.type != "cpu":
            return observation
        from ship_trl.fast.observe import CompiledVector

        # A number of one's own is in the reference alone.
        compiled, size = CompiledVector(observation), len(observation(torch.zeros(OWN_SIZE)))
        return compiled if compiled.size == size else observation

    def drawing(self, rasteriser: Rasteriser) -> Drawing:
        """Make the drawing."""
        kind = rasteriser.device.type
        if kind != "cpu":
            return Captured(rasteriser.reference) if kind == "cuda" else rasteriser.reference
        from ship_trl.fast.draw import CompiledDrawing

        return CompiledDrawing(rasteriser)


def make_backend(network: DuelingNetwork, draw: Draw, dtype: torch.dtype) -> Backend | None:
    """Make the backend that computes less than a whole picture, or than all places of ships."""
    if network.config.per_ship:
        from ship_trl.fast.packed import Packed

        return Packed(dtype)
    if not supports_incremental(network.geometry):
        return None
    from ship_trl.fast.incremental import Incremental

    return Incremental(cast(Any, draw).background, dtype, network.geometry)


def engine(fast: bool = True) -> Engine:
    """Return what computes worlds; if not `fast`, torch alone steps and draws."""
    return Fast() if fast else Slow()


def accelerator(fast: bool = True) -> Accelerator:
    """Return what makes learning faster; if not `fast`, nothing does."""
    return Accelerator(make_backend, Captured) if fast else Accelerator()


def make_env(
    suite: Suite | Case, world: World, num_envs: int = 1, *, fast: bool = True, **given: Any
) -> ShipEnv:
    """Make a `ShipEnv` with a fast engine; `given` are its other arguments."""
    return ShipEnv(suite, world, num_envs, engine=engine(fast), **given)


def make_step(world: World, device: torch.device | str = "cpu", *, fast: bool = True) -> Step:
    """Make the simulation step of a world."""
    return engine(fast).step(Transition(world, device))


def make_tracked_step(world: World, device: torch.device | str = "cpu", *, fast: bool = True) -> Step:
    """Make the simulation step of a world that also writes into states what has happened, see `Tracker`."""
    step, track = make_step(world, device, fast=fast), engine(fast).tracker(Tracker(world, device))

    def tracked(state: Tensor, action: Tensor) -> Outcome:
        after = step(state, action)
        return after._replace(state=track(state, after.state))

    return tracked


def make_starts(suite: Suite, world: World) -> Starts | TrafficStarts:
    """Make what draws the initial states of a suite."""
    return make_plain_starts(suite, world, Slow().scenes)


def draw_starts(suite: Suite, world: World, count: int, seed: int) -> Tensor:
    """Return states [count, S] at the start: of cases in turn, or of random encounters by seed."""
    starts = make_starts(suite, world)
    if suite.cases:
        return starts.balanced(count, Generator().manual_seed(seed + STARTS_SEED))
    return torch.cat([starts.sample(1, Generator().manual_seed(seed + k)) for k in range(count)])


def make_rasteriser(world: World, *, fast: bool = True, **given: Any) -> Rasteriser:
    """Make a `Rasteriser`; `given` are its other arguments."""
    return Rasteriser(world, drawing=engine(fast).drawing, **given)
