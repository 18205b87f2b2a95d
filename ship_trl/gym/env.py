"""The world for Gymnasium: `ShipCollision-v0`, one ship, pixels or numbers in, one of seven actions out."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Any

import gymnasium
import numpy as np

from ship_trl.gym.ships import LARGE_PICTURE, Infos, Observations, Pixels, Ships, check_render_mode

ENV_ID = "ShipCollision-v0"


class ShipCollisionEnv(gymnasium.Env[Observations, np.int64]):
    """One own ship in one case.

    Observation: uint8 [84, 84, C], C = 1 (grey) or 3 (`colour`); as a vector float32 [F], see
    `ship_trl.sim.vector`. Action: index into table 1.
    Reward: raw (equation 4), times `reward_scale`. `info` has `state` (the scene, see `ship_trl.sim.state`),
    `goal`, `collision` and `least_distance` (m, infinite without target ships). An episode starts as the case
    does; the seed matters only for a suite, whose starts are drawn.

    Args:
        case: name of a case or a suite, or the path of a case's YAML file.
        colour: pixels have three channels instead of one.
        reward_scale: factor of the reward; raw rewards reach 200.
        render_mode: "rgb_array" for the large picture, "human" for a window that shows each step, or None.
        fast: whether compiled loops step and draw; else torch does, which rounds differently.
        observation: "pixels" or "vector".
        vector_time: time (s) whose way a ship's speed vector shows in the pixels; 0 draws none.
        max_episode_steps: where an episode is truncated, by default after the world's 60; -1 for no limit.

    Raises:
        ConfigError: no such case, observation or render mode, or no screen.
    """

    # Gymnasium declares it on the instance.
    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        case: str = "1",
        colour: bool = False,
        reward_scale: float = 1.0,
        render_mode: str | None = None,
        fast: bool = True,
        observation: str = "pixels",
        vector_time: float = 0.0,
        max_episode_steps: int | None = None,
    ) -> None:
        check_render_mode(render_mode, self.metadata["render_modes"])
        self._ships = Ships(1, case, colour, fast, observation, vector_time, max_episode_steps)
        self._scale, self.render_mode = reward_scale, render_mode
        self._window, self._next_frame = ExitStack(), 0.0
        self.observation_space, self.action_space = self._ships.observation_space, self._ships.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start an episode."""
        super().reset(seed=seed)
        self._ships.seed([seed])
        self._ships.reset()
        return self._observe(goal=False, collision=False)

    def step(self, action: np.int64) -> tuple[Observations, float, bool, bool, Infos]:
        """Advance by one second: turn, then move.

        Raises:
            ValueError: the action is no whole number from 0 to 6.
        """
        reward, flags = self._ships.advance(action, ())
        goal, collision, truncated = flags[:, 0].tolist()
        observation, info = self._observe(goal, collision)
        return observation, float(reward[0]) * self._scale, goal or collision, truncated, info

    def _observe(self, goal: bool, collision: bool) -> tuple[Observations, Infos]:
        ships = self._ships
        if self.render_mode == "human":
            self._show()
        info = {"state": ships.state[0].copy(), "least_distance": float(ships.dcpa[0])}
        return ships.observe(ships.state)[0], info | {"goal": goal, "collision": collision}

    def render(self) -> Pixels | None:
        """Draw the large picture, uint8 [600, 600, 3]; a window shows each step by itself."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() draws nothing without render_mode")
        return self._ships.picture(0) if self.render_mode == "rgb_array" else None

    def _show(self) -> None:
        """Show the scene in the window, at most `render_fps` times a second."""
        # Imported here: training needs no pygame.
        import pygame

        from ship_trl.view.window.window import open_window

        if pygame.display.get_surface() is None:
            advice = "allowed without a screen: render_mode=rgb_array"
            self._window.enter_context(open_window((LARGE_PICTURE, LARGE_PICTURE), advice))
        window = pygame.display.get_surface()
        assert window is not None
        window.blit(self._ships.draw_large(0), (0, 0))
        # Without reading events the system takes the window for one that hangs.
        pygame.event.pump()
        pygame.display.flip()
        time.sleep(max(0.0, self._next_frame - time.monotonic()))
        self._next_frame = time.monotonic() + 1 / self.metadata["render_fps"]

    def close(self) -> None:
        """Close the window."""
        self._window.close()


class UnlimitedEnv(ShipCollisionEnv):
    """`ShipCollisionEnv` for `gymnasium.make`, whose `TimeLimit` truncates episodes in its place."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, max_episode_steps=-1)
