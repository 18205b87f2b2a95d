"""Ships of one case for both Gymnasium environments, stepped and observed in a batch."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Generator

from ship_trl.config.bounds import Seconds
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.schema import Reader
from ship_trl.config.types import Observation
from ship_trl.sim import scene
from ship_trl.sim.cases import load_world
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.starts import make_starts
from ship_trl.sim.state import first_case
from ship_trl.sim.suites import load_suite
from ship_trl.sim.transition import Transition
from ship_trl.sim.vector import VectorObservation

Pixels = NDArray[np.uint8]
# Pixels, channels last, or the numbers of a vector, float32.
Observations = NDArray[Any]
Flags = NDArray[np.bool_]
Infos = dict[str, Any]
LARGE_PICTURE = 600
# Steps. States are float32, which holds whole numbers up to it.
NO_LIMIT = 2**24


class Ships:
    """N own ships, each in its own episode: `state` float32 [N, S] and `dcpa` float32 [N] so far.

    They are observed as `pixels`, with speed vectors of `vector_time` seconds, or as a `vector` of numbers,
    as conf/network/vector.yaml wants them. If not `fast`, torch steps and draws in place of compiled loops,
    and rounds differently. Each ship has its own random numbers. `max_steps` is by default the world's; -1
    sets no limit.

    Raises:
        ConfigError: no such case or observation.
    """

    _draw: Callable[..., None]
    _step: Callable[..., None]

    def __init__(
        self,
        count: int,
        case: str,
        colour: bool,
        fast: bool,
        observation: str,
        vector_time: float,
        max_steps: int | None = None,
    ) -> None:
        kind: Observation = Reader().read(Observation, observation, "observation")
        self.world = load_world()
        self.suite = load_suite(str(case), self.world, "case")
        self._starts = make_starts(self.suite, self.world)
        self._generators = [Generator() for _ in range(count)]
        for generator in self._generators:
            generator.seed()
        ahead: float = Reader().read(Seconds, vector_time, "vector_time")
        rasteriser = Rasteriser(self.world, colour=colour, vector_time=ahead, fast=fast)
        # The starts of random encounters must not depend on the limit.
        limit = self.world.max_steps if max_steps is None else NO_LIMIT if max_steps == -1 else max_steps
        if not (isinstance(limit, int | np.integer) and 1 <= limit <= NO_LIMIT):
            allowed = f"a whole number from 1 to {NO_LIMIT}, or -1 for no limit"
            raise ConfigError(f"max_episode_steps: must be {allowed}, got {limit!r:.40}")
        transition = Transition(replace(self.world, max_steps=limit))
        if rasteriser.compiled is not None:
            # Imported here: without compiled loops nothing needs numba.
            from ship_trl.sim.fast.compiled import CompiledStep

            self._draw, self._step = rasteriser.compiled.draw_into, CompiledStep(transition).step_into
        else:
            self._draw, self._step = partial(draw_into, rasteriser), partial(step_into, transition)
        self._shape = (scene.SIZE, scene.SIZE, rasteriser.channels)
        self._encode: VectorObservation | None = None
        self.observation_space: spaces.Box = spaces.Box(0, 255, self._shape, np.uint8)
        if kind is Observation.vector:
            self._encode = VectorObservation(self.world, load_network("vector").ships)
            size = self._encode(self._starts.states[0]).numel()
            self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = spaces.Discrete(len(self.world.actions))
        self.state = np.empty((count, self._starts.states.shape[1]), np.float32)
        # Where each episode began: the map for people stays still.
        self._first_state = self.state.copy()
        self.dcpa = np.empty(count, np.float32)
        self.reset()

    def seed(self, seeds: Iterable[int | None]) -> None:
        """Seed the random numbers of each ship's starts; None goes on with those that it has.

        Raises:
            ValueError: a seed is not a whole number from 0 to 2**64 - 1.
        """
        for generator, seed in zip(self._generators, seeds, strict=True):
            if seed is not None:
                if not (isinstance(seed, int | np.integer) and 0 <= seed < 2**64):
                    raise ValueError(f"seed: must be a whole number from 0 to 2**64 - 1, got {seed!r:.40}")
                generator.manual_seed(int(seed))

    def reset(self, rows: Flags | slice = slice(None)) -> None:
        """Begin an episode in some rows, or in all."""
        self.dcpa[rows] = np.inf
        if self.suite.is_fixed:  # `draw` would add a twentieth to a step of 64 ships
            self.state[rows] = self._starts.states.numpy()
        else:
            drawn = np.arange(len(self.dcpa))[rows].tolist()
            self.state[rows] = np.concatenate([self._starts.draw(1, self._generators[row]) for row in drawn])
        self._first_state[rows] = self.state[rows]

    def advance(self, actions: object, shape: tuple[int, ...]) -> tuple[NDArray[np.float32], Flags]:
        """Advance by a step; return raw rewards [N], and goal, collision and truncated [3, N].

        Raises:
            ValueError: `actions` are not of the shape, no whole numbers, or out of range.
        """
        count, last, given = len(self.state), int(self.action_space.n) - 1, np.asarray(actions)
        if given.shape != shape or given.dtype.kind not in "iu":
            got = f"{given.dtype} {given.shape}"
            raise ValueError(f"actions: must be whole numbers from 0 to {last} of shape {shape}, got {got}")
        if (wrong := given[(given < 0) | (given > last)]).size:
            raise ValueError(f"actions: must be whole numbers from 0 to {last}, got {wrong[0]}")
        chosen = given.astype(np.int64).reshape(count)
        after, flags = np.empty_like(self.state), np.empty((3, count), np.bool_)
        reward, distance = np.empty((2, count), np.float32)
        self._step(self.state, chosen, after, reward, flags, distance)
        self.state, self.dcpa = after, np.minimum(self.dcpa, distance)
        return reward, flags

    def observe(self, state: NDArray[np.float32]) -> Observations:
        """Return what the network sees in states [N, S]: uint8 [N, 84, 84, C], or float32 [N, F]."""
        if self._encode is not None:
            with torch.inference_mode():  # a sixth faster
                return self._encode(torch.from_numpy(state)).numpy()
        *image, channels = self._shape
        pictures = np.empty((len(state), channels, math.prod(image)), np.uint8)
        self._draw(state, pictures)
        return np.ascontiguousarray(pictures.swapaxes(1, 2)).reshape(len(state), *image, channels)

    def draw_large(self, row: int) -> Any:
        """Draw the scene of a row for people; return a pygame surface of 600 x 600 pixels."""
        # Imported here: training needs no pygame.
        from ship_trl.view.painter import draw_scene

        state = torch.from_numpy(self.state[row])
        start = torch.from_numpy(self._first_state[row])
        return draw_scene(first_case(self.suite, state), self.world, state, LARGE_PICTURE, start)

    def picture(self, row: int) -> Pixels:
        """Draw the scene of a row for people: uint8 [600, 600, 3]."""
        from ship_trl.view.pen import to_array

        return to_array(self.draw_large(row))


def check_render_mode(mode: str | None, allowed: Sequence[str]) -> None:
    """Check the argument `render_mode`.

    Raises:
        ConfigError: it is no allowed mode.
    """
    if mode is not None and mode not in allowed:
        raise ConfigError(f"render_mode: must be None or one of {', '.join(allowed)}, got {mode!r:.40}")


def step_into(
    transition: Transition,
    state: NDArray[np.float32],
    action: NDArray[np.int64],
    after: NDArray[np.float32],
    reward: NDArray[np.float32],
    flags: Flags,
    distance: NDArray[np.float32],
) -> None:
    """Take a step in torch and write its results, as `CompiledStep.step_into`."""
    outcome = transition(torch.from_numpy(state), torch.from_numpy(action))
    after[:], reward[:], distance[:] = outcome.state, outcome.reward, outcome.min_distance
    flags[:] = torch.stack((outcome.goal, outcome.collision, outcome.truncated))


def draw_into(rasteriser: Rasteriser, state: NDArray[np.float32], pictures: Pixels) -> None:
    """Draw states [N, S] in torch into `pictures`, uint8 [N, C, 84 * 84]."""
    pictures[:] = rasteriser.reference(torch.from_numpy(state))
