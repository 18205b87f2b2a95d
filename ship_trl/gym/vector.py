"""Many ships of one case for Gymnasium, stepped and drawn at once: `ShipCollision-v0` as a vector.

import gymnasium
name = "ship_trl.gym:ShipCollision-v0"
envs = gymnasium.make_vec(name, num_envs=64, vectorization_mode="vector_entry_point", case="4")
"""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ship_trl.sim import scene
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.dynamics import STATE_SIZE
from ship_trl.sim.fast.compiled import CompiledStep
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.transition import Transition

Pixels = NDArray[np.uint8]
Infos = dict[str, Any]


class ShipCollisionVectorEnv(gymnasium.vector.VectorEnv[Pixels, NDArray[np.int64], NDArray[Any]]):
    """N own ships in one case, each in an episode of its own.

    Observation: uint8 [N, 84, 84, C], C = 1 (grey) or 3 (`colour`). Action: int64 [N], index into
    table 1. Reward: float32 [N], raw (equation 4) times `reward_scale`. `infos` has `state` [N, 4],
    `goal`, `collision` and `dcpa` [N] as in `ShipCollisionEnv`. An episode that ends is reset in the
    same step: its first observation is returned, and `infos["final_obs"]` (objects [N], a picture or
    None) and `infos["final_info"]` hold the last one, for the rows in `infos["_final_obs"]` (bool [N]).

    Args:
        num_envs: N.
        case: name of a case, or the path of a YAML file.
        colour: three channels instead of one.
        reward_scale: factor of the reward.

    Raises:
        ConfigError: no such case.
        ValueError: num_envs is less than 1.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self, num_envs: int = 1, case: str = "1", colour: bool = False, reward_scale: float = 1.0
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs is {num_envs}; at least 1 is needed")
        world = load_world()
        loaded = load_case(case, world)
        rasteriser = Rasteriser(loaded, world, colour=colour)
        reference = Transition(loaded, world, torch.device("cpu"))
        assert rasteriser.compiled is not None
        self._draw, self._step = rasteriser.compiled.draw_into, CompiledStep(reference).step_into
        self._scale, self._start = np.float32(reward_scale), reference.start.numpy()
        self.num_envs = num_envs
        shape = (scene.SIZE, scene.SIZE, rasteriser.channels)
        self.single_observation_space: spaces.Box = spaces.Box(0, 255, shape, np.uint8)
        self.single_action_space = spaces.Discrete(len(world.actions))
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._begin()

    def _begin(self) -> None:
        self._state = np.tile(self._start, (self.num_envs, 1))
        self._dcpa = np.full(self.num_envs, np.inf, np.float32)

    def _pictures(self, state: NDArray[np.float32]) -> Pixels:
        *image, channels = self.single_observation_space.shape
        pictures = np.empty((len(state), channels, math.prod(image)), np.uint8)
        self._draw(state, pictures)
        return np.ascontiguousarray(pictures.swapaxes(1, 2)).reshape(len(state), *image, channels)

    def _infos(self, goal: NDArray[np.bool_], collision: NDArray[np.bool_]) -> Infos:
        return {"state": self._state.copy(), "goal": goal, "collision": collision, "dcpa": self._dcpa.copy()}

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Pixels, Infos]:
        """Reset all episodes; the case fixes the start, so the seed changes nothing."""
        self._begin()
        no = np.zeros(self.num_envs, np.bool_)
        return self._pictures(self._state), self._infos(no, no.copy())

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Pixels, NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], Infos]:
        """Advance every ship by one second: turn, then move.

        Raises:
            ValueError: `actions` is not one action per ship.
            IndexError: an action index is out of range.
        """
        count = self.num_envs
        actions = np.ascontiguousarray(actions, np.int64)
        if actions.shape != (count,):
            raise ValueError(f"{count} actions are needed, not an array of shape {actions.shape}")
        after = np.empty((count, STATE_SIZE), np.float32)
        reward, apart = np.empty((2, count), np.float32)
        flags = np.empty((3, count), np.bool_)
        self._step(self._state, actions, after, reward, flags, apart)
        goal, collision, truncated = flags
        terminated = goal | collision
        over = terminated | truncated
        self._state, self._dcpa = after, np.minimum(self._dcpa, apart)
        ends: Infos = {}
        if over.any():
            last = np.full(count, None, object)
            for row, picture in zip(over.nonzero()[0], self._pictures(after[over]), strict=True):
                last[row] = picture
            ends = {"final_obs": last, "final_info": self._infos(goal, collision)}
            ends |= {f"_{key}": over for key in tuple(ends)}
            self._state[over], self._dcpa[over] = self._start, np.inf
        infos = self._infos(goal & ~over, collision & ~over) | ends
        return self._pictures(self._state), reward * self._scale, terminated, truncated, infos
