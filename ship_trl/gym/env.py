"""The same world for Gymnasium: `ShipCollision-v0`, one ship, pixels in, one of seven actions out."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray

from ship_trl.gym.ships import Flags, Infos, Pixels, Ships

ENV_ID = "ShipCollision-v0"
LARGE_PICTURE = 600


class ShipCollisionEnv(gymnasium.Env[NDArray[np.uint8], np.int64]):
    """One own ship in one case.

    Observation: uint8 [84, 84, C], C = 1 (grey) or 3 (`colour`). Action: index into table 1.
    Reward: raw (equation 4), times `reward_scale`. `info` has `state` (x, y, heading, step), `goal`,
    `collision` and `dcpa` (m, infinite without target ships). The start is fixed by the case, so
    the seed changes nothing.

    Args:
        case: name of a case, or the path of a YAML file.
        colour: three channels instead of one.
        reward_scale: factor of the reward; raw rewards reach 200.
        render_mode: "rgb_array" for the large picture, "human" for a window; None for neither.

    Raises:
        ConfigError: no such case.
    """

    # Gymnasium declares it on the instance.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        case: str = "1",
        colour: bool = False,
        reward_scale: float = 1.0,
        render_mode: str | None = None,
    ) -> None:
        self._ships = Ships(1, case, colour)
        self._scale, self.render_mode = reward_scale, render_mode
        self._window: Any = None
        self.observation_space, self.action_space = self._ships.observation_space, self._ships.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Pixels, Infos]:
        """Start an episode."""
        super().reset(seed=seed)
        self._ships.begin()
        return self._observe(np.zeros((3, 1), np.bool_))

    def step(self, action: np.int64) -> tuple[Pixels, float, bool, bool, Infos]:
        """Advance by one second: turn, then move."""
        reward, flags = self._ships.advance(np.array([action], np.int64))
        goal, collision, truncated = flags[:, 0].tolist()
        pixels, info = self._observe(flags)
        return pixels, float(reward[0]) * self._scale, goal or collision, truncated, info

    def _observe(self, flags: Flags) -> tuple[Pixels, Infos]:
        if self.render_mode == "human":
            self.render()
        ships = self._ships
        info = {"state": ships.state[0].copy(), "dcpa": float(ships.dcpa[0])}
        info |= {"goal": bool(flags[0, 0]), "collision": bool(flags[1, 0])}
        return ships.draw(ships.state)[0], info

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the large picture, as uint8 [600, 600, 3] or in a window."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() draws nothing without render_mode")
            return None
        # Imported here: training needs no pygame.
        import pygame

        from ship_trl.view.painter import draw_scene
        from ship_trl.view.pen import to_array

        ships = self._ships
        picture = draw_scene(ships.case, ships.world, torch.from_numpy(ships.state[0]), LARGE_PICTURE)
        if self.render_mode == "rgb_array":
            return to_array(picture)
        if self._window is None:
            pygame.display.init()
            self._window = pygame.display.set_mode((LARGE_PICTURE, LARGE_PICTURE))
            pygame.display.set_caption(f"case {ships.case.name}")
        self._window.blit(picture, (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        pygame.time.wait(1000 // self.metadata["render_fps"])
        return None

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            import pygame

            pygame.display.quit()
            self._window = None
