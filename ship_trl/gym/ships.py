"""Ships of one case for both Gymnasium environments: stepped and drawn at once, pictures channels last."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray

from ship_trl.sim import scene
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.fast.compiled import CompiledStep
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.transition import Transition

Pixels = NDArray[np.uint8]
Flags = NDArray[np.bool_]
Infos = dict[str, Any]


class Ships:
    """N own ships, each in an episode of its own: `state` float32 [N, 4] and `dcpa` float32 [N] so far.

    Raises:
        ConfigError: no such case.
    """

    def __init__(self, count: int, case: str, colour: bool) -> None:
        self.world = load_world()
        self.case = load_case(case, self.world)
        rasteriser = Rasteriser(self.case, self.world, colour=colour)
        reference = Transition(self.case, self.world, torch.device("cpu"))
        assert rasteriser.compiled is not None
        self._draw, self._step = rasteriser.compiled.draw_into, CompiledStep(reference).step_into
        self._start, self._count = reference.start.numpy(), count
        self._shape = (scene.SIZE, scene.SIZE, rasteriser.channels)
        self.observation_space = spaces.Box(0, 255, self._shape, np.uint8)
        self.action_space = spaces.Discrete(len(self.world.actions))
        self.begin()

    def begin(self) -> None:
        """Put all ships at the start."""
        self.state = np.tile(self._start, (self._count, 1))
        self.dcpa = np.full(self._count, np.inf, np.float32)

    def begin_again(self, over: Flags) -> None:
        """Put the ships of some rows at the start."""
        self.state[over], self.dcpa[over] = self._start, np.inf

    def advance(self, actions: NDArray[np.int64]) -> tuple[NDArray[np.float32], Flags]:
        """Advance by a step; return raw rewards [N], and goal, collision and truncated [3, N].

        Raises:
            IndexError: an action index is out of range.
        """
        after, flags = np.empty_like(self.state), np.empty((3, self._count), np.bool_)
        reward, apart = np.empty((2, self._count), np.float32)
        self._step(self.state, actions, after, reward, flags, apart)
        self.state, self.dcpa = after, np.minimum(self.dcpa, apart)
        return reward, flags

    def draw(self, state: NDArray[np.float32]) -> Pixels:
        """Draw what the network sees in states [N, 4]: uint8 [N, 84, 84, C]."""
        *image, channels = self._shape
        pictures = np.empty((len(state), channels, math.prod(image)), np.uint8)
        self._draw(state, pictures)
        return np.ascontiguousarray(pictures.swapaxes(1, 2)).reshape(len(state), *image, channels)

    def infos(self, goal: Flags, collision: Flags) -> Infos:
        """Return copies of state and DCPA beside the flags of the last step."""
        return {"state": self.state.copy(), "goal": goal, "collision": collision, "dcpa": self.dcpa.copy()}
