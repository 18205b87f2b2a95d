"""Ships of one case for both Gymnasium environments, stepped and observed in a batch."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Generator

from ship_trl.config.bounds import Seconds
from ship_trl.config.network import load_network
from ship_trl.config.schema import Reader
from ship_trl.config.types import Observation
from ship_trl.sim import scene
from ship_trl.sim.cases import load_world
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.starts import make_starts
from ship_trl.sim.suites import load_suite
from ship_trl.sim.transition import Transition
from ship_trl.sim.vector import VectorObservation

Pixels = NDArray[np.uint8]
# Pixels, channels last, or the numbers of a vector, float32.
Observations = NDArray[Any]
Flags = NDArray[np.bool_]
Infos = dict[str, Any]


class Ships:
    """N own ships, each in its own episode: `state` float32 [N, S] and `dcpa` float32 [N] so far.

    They are observed as `pixels`, with speed vectors of `vector_time` seconds, or as a `vector` of numbers,
    as conf/network/vector.yaml wants them. If not `fast`, torch steps and draws in place of compiled loops,
    and rounds differently.

    Raises:
        ConfigError: no such case or observation.
    """

    _draw: Callable[..., None]
    _step: Callable[..., None]

    def __init__(
        self, count: int, case: str, colour: bool, fast: bool, observation: str, vector_time: float
    ) -> None:
        kind: Observation = Reader().read(Observation, observation, "observation")
        self.world, self._is_seeded = load_world(), False
        self.suite = load_suite(str(case), self.world, "case")
        self._starts, self._generator = make_starts(self.suite, self.world), Generator().manual_seed(0)
        self.vector_time: float = Reader().read(Seconds, vector_time, "vector_time")
        rasteriser = Rasteriser(self.world, colour=colour, vector_time=self.vector_time, fast=fast)
        transition = Transition(self.world)
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
        self.dcpa = np.empty(count, np.float32)
        self.reset()

    def seed(self, seed: int | None, random: np.random.Generator) -> None:
        """Seed the random numbers of the starts; the first time without a seed, by a random one."""
        if seed is None and not self._is_seeded:
            seed = int(random.integers(2**62))
        if seed is not None:
            self._generator.manual_seed(seed)
            self._is_seeded = True

    def reset(self, rows: Flags | slice = slice(None)) -> None:
        """Begin an episode in some rows, or in all."""
        self.dcpa[rows] = np.inf
        if self.suite.is_fixed:  # `draw` would add a twentieth to a step of 64 ships
            self.state[rows] = self._starts.states.numpy()
        else:
            self.state[rows] = self._starts.draw(len(self.dcpa[rows]), self._generator)

    def advance(self, actions: NDArray[np.int64]) -> tuple[NDArray[np.float32], Flags]:
        """Advance by a step; return raw rewards [N], and goal, collision and truncated [3, N].

        Raises:
            IndexError: an action index is out of range.
        """
        count = len(actions)
        after, flags = np.empty_like(self.state), np.empty((3, count), np.bool_)
        reward, distance = np.empty((2, count), np.float32)
        self._step(self.state, actions, after, reward, flags, distance)
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
    if action.min() < 0:  # torch would count from the last action
        raise IndexError("action index out of range")
    outcome = transition(torch.from_numpy(state), torch.from_numpy(action))
    after[:], reward[:], distance[:] = outcome.state, outcome.reward, outcome.min_distance
    flags[:] = torch.stack((outcome.goal, outcome.collision, outcome.truncated))


def draw_into(rasteriser: Rasteriser, state: NDArray[np.float32], pictures: Pixels) -> None:
    """Draw states [N, S] in torch into `pictures`, uint8 [N, C, 84 * 84]."""
    pictures[:] = rasteriser.reference(torch.from_numpy(state))
