"""Many ships of one case for Gymnasium, stepped and observed in a batch: `ShipCollision-v0` as a vector.

import gymnasium
name = "ship_trl.gym:ShipCollision-v0"
envs = gymnasium.make_vec(name, num_envs=64, vectorization_mode="vector_entry_point", case="4")
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.random import SeedSequence
from numpy.typing import NDArray

from ship_trl.gym.ships import Flags, Infos, Observations, Ships


class ShipCollisionVectorEnv(gymnasium.vector.VectorEnv[Observations, NDArray[np.int64], NDArray[Any]]):
    """N own ships in one case, each in its own episode; arguments and `infos` as in `ShipCollisionEnv`.

    Observation: uint8 [N, 84, 84, C] or float32 [N, F]. Action: int64 [N]. Reward: float32 [N]. An episode
    that ends is reset in the same step. The first observation of the next one is returned. The last one is in
    `infos["final_obs"]` (objects [N], an observation or None) with `infos["final_info"]`, for the rows in
    `infos["_final_obs"]` (bool [N]).

    Raises:
        ConfigError: no such case or observation.
        ValueError: num_envs is less than 1.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        case: str = "1",
        colour: bool = False,
        reward_scale: float = 1.0,
        fast: bool = True,
        observation: str = "pixels",
        vector_time: float = 0.0,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs: must be at least 1, got {num_envs}")
        self._ships = Ships(num_envs, case, colour, fast, observation, vector_time)
        self._scale, self.num_envs = np.float32(reward_scale), num_envs
        self.single_observation_space: spaces.Box = self._ships.observation_space
        self.single_action_space = self._ships.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Reset all episodes; the seed matters only for a suite, whose starts are drawn."""
        if isinstance(seed, list):
            parts = [part or 0 for part in seed]
            seed = parts[0] if len(parts) == 1 else int(SeedSequence(parts).generate_state(1)[0])
        self._ships.seed(seed, self.np_random)
        self._ships.reset()
        return self._ships.observe(self._ships.state), self._infos(*np.zeros((2, self.num_envs), np.bool_))

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Observations, NDArray[np.float32], Flags, Flags, Infos]:
        """Advance every ship by one second: turn, then move.

        Raises:
            ValueError: `actions` is not one action per ship.
            IndexError: an action index is out of range.
        """
        ships, count = self._ships, self.num_envs
        actions = np.ascontiguousarray(actions, np.int64)
        if actions.shape != (count,):
            raise ValueError(f"actions: must have the shape ({count},), got {actions.shape}")
        reward, (goal, collision, truncated) = ships.advance(actions)
        terminated = goal | collision
        over = terminated | truncated
        ends: Infos = {}
        if over.any():
            last = np.full(count, None, object)
            for row, observation in zip(over.nonzero()[0], ships.observe(ships.state[over]), strict=True):
                last[row] = observation
            ends = {"final_obs": last, "final_info": self._infos(goal, collision)}
            ends |= {"_final_obs": over, "_final_info": over}
            ships.reset(over)
        infos = self._infos(goal & ~over, collision & ~over) | ends
        return ships.observe(ships.state), reward * self._scale, terminated, truncated, infos

    def _infos(self, goal: Flags, collision: Flags) -> Infos:
        ships = self._ships
        return {"state": ships.state.copy(), "goal": goal, "collision": collision, "dcpa": ships.dcpa.copy()}
