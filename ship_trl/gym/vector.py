"""Many ships of one case for Gymnasium, stepped and observed in a batch: `ShipCollision-v0` as a vector.

import gymnasium
name = "ship_trl.gym:ShipCollision-v0"
envs = gymnasium.make_vec(name, num_envs=64, vectorization_mode="vector_entry_point", case="4")
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ship_trl.config.errors import ConfigError
from ship_trl.gym.ships import Flags, Infos, Observations, Pixels, Ships, check_render_mode


class ShipCollisionVectorEnv(gymnasium.vector.VectorEnv[Observations, NDArray[np.int64], NDArray[Any]]):
    """N own ships in one case, each in its own episode; arguments and `infos` as in `ShipCollisionEnv`.

    Observation: uint8 [N, 84, 84, C] or float32 [N, F]. Action: int64 [N]. Reward: float32 [N]. It gives what
    Gymnasium's `SyncVectorEnv` of N single environments gives. By `autoreset_mode` an episode that ends

    - SAME_STEP: is reset in the same step. The first observation of the next one is returned. The last one
      is in `infos["final_obs"]` (objects [N], an observation or None) with `infos["final_info"]`, for the
      rows in `infos["_final_obs"]` (bool [N]).
    - NEXT_STEP: is reset by the next step, which ignores the action and has reward 0. Gymnasium's wrappers
      that change observations need it.
    - DISABLED: is reset by `reset(options={"reset_mask": rows})` alone, bool [N].

    Raises:
        ConfigError: no such case, observation, render mode or mode.
        ValueError: num_envs is less than 1.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        case: str = "1",
        colour: bool = False,
        reward_scale: float = 1.0,
        fast: bool = True,
        observation: str = "pixels",
        vector_time: float = 0.0,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs: must be at least 1, got {num_envs}")
        check_render_mode(render_mode, self.metadata["render_modes"])
        modes = [mode.value for mode in AutoresetMode]
        if autoreset_mode not in (*AutoresetMode, *modes):
            allowed = ", ".join(modes)
            raise ConfigError(f"autoreset_mode: must be one of {allowed}, got {autoreset_mode!r:.40}")
        # TorchRL reads the attribute, Gymnasium's wrappers the metadata.
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self._ships = Ships(num_envs, case, colour, fast, observation, vector_time, max_episode_steps)
        self._scale, self.num_envs, self.render_mode = np.float32(reward_scale), num_envs, render_mode
        self.single_observation_space: spaces.Box = self._ships.observation_space
        self.single_action_space = self._ships.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        # Rows whose episode has ended, and is not reset yet.
        self._over: Flags = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Reset all episodes, or those in `options["reset_mask"]`, bool [N].

        Row i begins with the scene of the single environment's seed `seed + i`, or `seed[i]`; where it is
        None, its random numbers go on. Seeds matter only for a suite, whose starts are drawn.

        Raises:
            ValueError: seeds or mask are not one a row, or the mask is empty.
        """
        ships, count = self._ships, self.num_envs
        rows = np.asarray((options or {}).get("reset_mask", np.ones(count, np.bool_)))
        if rows.shape != (count,) or rows.dtype != np.bool_ or not rows.any():
            got = f"{rows.dtype} {list(rows.shape)}"
            raise ValueError(f"reset_mask: must be bool [{count}] with at least one True, got {got}")
        first: Any = [None] * count if seed is None else seed
        is_number = isinstance(first, int | float | np.number)
        seeds = [first + row for row in range(count)] if is_number else list(first)
        if len(seeds) != count:
            raise ValueError(f"seed: must be one number or a list of {count}, got a list of {len(seeds)}")
        ships.seed(one if row else None for one, row in zip(seeds, rows, strict=True))
        ships.reset(rows)
        self._over = self._over & ~rows
        infos = self._infos(*np.zeros((2, count), np.bool_))
        if not rows.all():
            infos |= {f"_{key}": rows.copy() for key in infos}
        return ships.observe(ships.state), infos

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Observations, NDArray[np.float32], Flags, Flags, Infos]:
        """Advance every ship by one second: turn, then move.

        Raises:
            ValueError: `actions` is not one action per ship, or one is out of range.
            ResetNeeded: the mode is DISABLED, and an episode that has ended was not reset.
        """
        ships, mode, resets = self._ships, self.autoreset_mode, self._over
        if mode is AutoresetMode.DISABLED and resets.any():
            ended = resets.nonzero()[0].tolist()
            raise ResetNeeded(
                f"episodes {ended!s:.60} have ended; reset them by options={{'reset_mask': rows}}"
            )
        reward, (goal, collision, truncated) = ships.advance(actions, (self.num_envs,))
        if mode is AutoresetMode.NEXT_STEP and resets.any():
            ships.reset(resets)
            for values in (reward, goal, collision, truncated):
                values[resets] = 0
        terminated = goal | collision
        self._over = over = terminated | truncated
        ends: Infos = {}
        if mode is AutoresetMode.SAME_STEP and over.any():
            last = np.full(self.num_envs, None, object)
            for row, observation in zip(over.nonzero()[0], ships.observe(ships.state[over]), strict=True):
                last[row] = observation
            ends = {"final_obs": last, "final_info": self._infos(goal, collision)}
            ends |= {"_final_obs": over, "_final_info": over}
            ships.reset(over)
            goal, collision = goal & ~over, collision & ~over
        infos = self._infos(goal, collision) | ends
        return ships.observe(ships.state), reward * self._scale, terminated, truncated, infos

    def render(self) -> tuple[Pixels, ...] | None:
        """Draw the large picture of each row, uint8 [600, 600, 3]."""
        is_drawn = self.render_mode is not None
        return tuple(self._ships.picture(row) for row in range(self.num_envs)) if is_drawn else None

    def _infos(self, goal: Flags, collision: Flags) -> Infos:
        ships = self._ships
        ends = {"goal": goal, "collision": collision}
        return {"state": ships.state.copy(), "least_distance": ships.dcpa.copy(), **ends}
