"""The same world for Gymnasium: `ShipCollision-v0`, one ship, pixels in, one of seven actions out."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray

from ship_trl.sim import scene
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.fast.compiled import CompiledStep
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.transition import Transition

ENV_ID = "ShipCollision-v0"
WINDOW_PIXELS = 600


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
        render_mode: "rgb_array" or "human" for the large picture; None for none.

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
        self._world = load_world()
        self._case = load_case(case, self._world)
        self._rasteriser = Rasteriser(self._case, self._world, colour=colour)
        reference = Transition(self._case, self._world, torch.device("cpu"))
        assert self._rasteriser.compiled is not None
        self._draw, self._advance = self._rasteriser.compiled.draw_into, CompiledStep(reference).step_into
        self._start = reference.start[None].numpy()
        self._reward_scale = reward_scale
        self.render_mode = render_mode
        shape = (scene.SIZE, scene.SIZE, self._rasteriser.channels)
        self.observation_space = spaces.Box(0, 255, shape, np.uint8)
        self._shape = shape
        self.action_space = spaces.Discrete(len(self._world.actions))
        self._state, self._dcpa = self._start, math.inf
        self._window: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        self._state, self._dcpa = self._start, math.inf
        return self._observed(goal=False, collision=False)

    def step(self, action: np.int64) -> tuple[NDArray[np.uint8], float, bool, bool, dict[str, Any]]:
        """Advance by one second: turn, then move."""
        after, flags = np.empty_like(self._state), np.empty((3, 1), np.bool_)
        reward, apart = np.empty((2, 1), np.float32)
        self._advance(self._state, np.array([action], np.int64), after, reward, flags, apart)
        self._state, self._dcpa = after, min(self._dcpa, float(apart[0]))
        goal, collision, truncated = flags[:, 0].tolist()
        pixels, info = self._observed(goal, collision)
        return pixels, float(reward[0]) * self._reward_scale, goal or collision, truncated, info

    def _observed(self, goal: bool, collision: bool) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        if self.render_mode == "human":
            self.render()
        info = {"state": self._state[0].copy(), "goal": goal, "collision": collision, "dcpa": self._dcpa}
        height, width, channels = self._shape
        pixels = np.empty((1, channels, height * width), np.uint8)
        self._draw(self._state, pixels)
        return np.ascontiguousarray(pixels[0].T).reshape(height, width, channels), info

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the large picture as uint8 [600, 600, 3], or in a window with render_mode "human"."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() draws nothing without render_mode")
            return None
        # Imported here: training needs no pygame.
        from ship_trl.view.painter import draw_scene
        from ship_trl.view.pen import to_array

        picture = draw_scene(self._case, self._world, torch.from_numpy(self._state[0]), WINDOW_PIXELS)
        if self.render_mode == "rgb_array":
            return to_array(picture)
        import pygame

        if self._window is None:
            pygame.display.init()
            self._window = pygame.display.set_mode((WINDOW_PIXELS, WINDOW_PIXELS))
            pygame.display.set_caption(f"case {self._case.name}")
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
