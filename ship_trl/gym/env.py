"""The world for Gymnasium: `ShipCollision-v0`, one ship, pixels or numbers in, one of seven actions out."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray

from ship_trl.gym.ships import Infos, Observations, Ships
from ship_trl.sim.state import first_case

ENV_ID = "ShipCollision-v0"
LARGE_PICTURE = 600


class ShipCollisionEnv(gymnasium.Env[Observations, np.int64]):
    """One own ship in one case.

    Observation: uint8 [84, 84, C], C = 1 (grey) or 3 (`colour`); as a vector float32 [F], see
    `ship_trl.sim.vector`. Action: index into table 1.
    Reward: raw (equation 4), times `reward_scale`. `info` has `state` (the scene, see `ship_trl.sim.state`),
    `goal`, `collision` and `dcpa` (m, infinite without target ships). An episode starts as the case does; the
    seed matters only for a suite, whose starts are drawn.

    Args:
        case: name of a case or a suite, or the path of a case's YAML file.
        colour: pixels have three channels instead of one.
        reward_scale: factor of the reward; raw rewards reach 200.
        render_mode: "rgb_array" for the large picture, or None.
        fast: whether compiled loops step and draw; else torch does, which rounds differently.
        observation: "pixels" or "vector".
        vector_time: time (s) whose way a ship's speed vector shows in the pixels; 0 draws none.

    Raises:
        ConfigError: no such case or observation.
    """

    # Gymnasium declares it on the instance.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        case: str = "1",
        colour: bool = False,
        reward_scale: float = 1.0,
        render_mode: str | None = None,
        fast: bool = True,
        observation: str = "pixels",
        vector_time: float = 0.0,
    ) -> None:
        self._ships = Ships(1, case, colour, fast, observation, vector_time)
        self._scale, self.render_mode = reward_scale, render_mode
        self.observation_space, self.action_space = self._ships.observation_space, self._ships.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start an episode."""
        super().reset(seed=seed)
        self._ships.seed(seed, self.np_random)
        self._ships.reset()
        return self._observe(goal=False, collision=False)

    def step(self, action: np.int64) -> tuple[Observations, float, bool, bool, Infos]:
        """Advance by one second: turn, then move."""
        reward, flags = self._ships.advance(np.array([action], np.int64))
        goal, collision, truncated = flags[:, 0].tolist()
        observation, info = self._observe(goal, collision)
        return observation, float(reward[0]) * self._scale, goal or collision, truncated, info

    def _observe(self, goal: bool, collision: bool) -> tuple[Observations, Infos]:
        ships = self._ships
        info = {"state": ships.state[0].copy(), "dcpa": float(ships.dcpa[0])}
        return ships.observe(ships.state)[0], info | {"goal": goal, "collision": collision}

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the large picture, uint8 [600, 600, 3]."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() draws nothing without render_mode")
            return None
        # Imported here: training needs no pygame.
        from ship_trl.view.painter import draw_scene
        from ship_trl.view.pen import to_array

        ships = self._ships
        state = torch.from_numpy(ships.state[0])
        case = first_case(ships.suite, state)
        return to_array(draw_scene(case, ships.world, state, LARGE_PICTURE, ships.vector_time))
