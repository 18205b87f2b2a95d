"""The same world by plain Python numbers, pygame and Gymnasium.

`PygameShipEnv` draws as most people would; `TunedPygameShipEnv` as little as pygame can: what moves,
with hard edges, into bytes. They share constants with the simulator and no code, so a test can
hold one against the other.
"""

from __future__ import annotations

import math
import os
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ship_trl.bench.work import FRAME
from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame

# A millimetre, for the rounding of positions.
ROUNDING = 1e-3
OVERSAMPLING = 4


def grey(colour: tuple[int, int, int]) -> int:
    """How bright a colour looks, 0 to 255."""
    return round(sum(share * value for share, value in zip(scene.LUMINANCE, colour, strict=True)))


def still_picture(world: World) -> NDArray[np.uint8]:
    """Draw what never moves in an own-ship-centred view, once: uint8 [84, 84]."""
    size = scene.SIZE * OVERSAMPLING
    scale = scene.PIXELS_PER_METRE * OVERSAMPLING
    picture = pygame.Surface((size, size), depth=32)
    shade = lambda colour: (grey(colour),) * 3  # noqa: E731
    picture.fill(shade(scene.OUTSIDE))
    for radius, colour in (
        (scene.WINDOW, scene.DISC),
        (world.goal_distance, scene.GOAL_CIRCLE),
        (world.safe_distance, scene.SAFE_CIRCLE),
    ):
        pygame.draw.circle(picture, shade(colour), (size / 2, size / 2), radius * scale)
    corners = [(size / 2 - v * scale, size / 2 - u * scale) for u, v in scene.ship_outline(scene.OWN_LENGTH)]
    pygame.draw.polygon(picture, shade(scene.OWN), corners)
    small = pygame.transform.smoothscale(picture, (scene.SIZE, scene.SIZE))
    return np.ascontiguousarray(pygame.surfarray.array3d(small)[:, :, 0].T)


class PygameShipEnv(gymnasium.Env[NDArray[np.uint8], np.int64]):
    """One own ship in one case: uint8 [1, 84, 84] in, one of seven actions out.

    Args:
        case: where the ships and the goal are.
        world: the physics.
        reward_scale: factor of the reward.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium declares it on the instance)

    def __init__(self, case: Case, world: World, reward_scale: float = 1.0) -> None:
        self.observation_space = spaces.Box(0, 255, FRAME, np.uint8)
        self.action_space = spaces.Discrete(len(world.actions))
        self._case, self._world, self._scale = case, world, reward_scale
        self._actions = [(speed, turn) for speed, turn in world.actions]
        self._ships = []
        for ship in case.target_ships:
            course = math.radians(ship.heading)
            self._ships.append(
                (ship.x, ship.y, ship.speed * math.cos(course), ship.speed * math.sin(course), course)
            )
        self._prepare()
        self._outline = [
            (u * scene.PIXELS_PER_METRE, v * scene.PIXELS_PER_METRE)
            for u, v in scene.ship_outline(scene.TARGET_LENGTH)
        ]
        self._start()

    def _start(self) -> None:
        self._x, self._y = map(float, self._case.start)
        self._heading, self._time = math.radians(self._case.heading), 0
        self._dcpa = math.inf

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        self._start()
        return self._draw(), self._info(False, False)

    def step(self, action: np.int64) -> tuple[NDArray[np.uint8], float, bool, bool, dict[str, Any]]:
        """One second: turn, then move."""
        world, dt = self._world, self._world.dt
        speed, turn = self._actions[action]
        x, y, time = self._x, self._y, self._time * dt
        self._heading += turn * dt
        self._x += speed * dt * math.cos(self._heading)
        self._y += speed * dt * math.sin(self._heading)
        self._time += 1
        nearest = math.inf
        for sx, sy, vx, vy, _ in self._ships:
            # The other ship as seen from ours moves on a straight line within the step.
            ax, ay = sx + time * vx - x, sy + time * vy - y
            bx, by = sx + (time + dt) * vx - self._x, sy + (time + dt) * vy - self._y
            dx, dy = bx - ax, by - ay
            length2 = dx * dx + dy * dy
            share = min(1.0, max(0.0, -(ax * dx + ay * dy) / length2)) if length2 > 0 else 0.0
            nearest = min(nearest, math.hypot(ax + share * dx, ay + share * dy))
        self._dcpa = min(self._dcpa, nearest)
        collision = nearest < world.safe_distance
        gx, gy = self._case.goal[0] - self._x, self._case.goal[1] - self._y
        distance = math.hypot(gx, gy)
        goal = not collision and distance <= world.goal_distance + ROUNDING
        off_bow = math.degrees(math.remainder(math.atan2(gy, gx) - self._heading, math.tau))
        weights = world.reward
        reward = weights.w3 * weights.k1 * distance + weights.w4 * weights.k2 * abs(off_bow)
        if goal:
            reward += weights.w1 * weights.goal
        elif collision:
            reward += weights.w2 * weights.collision
        terminated = goal or collision
        truncated = self._time >= world.max_steps and not terminated
        return self._draw(), reward * self._scale, terminated, truncated, self._info(goal, collision)

    def _info(self, goal: bool, collision: bool) -> dict[str, Any]:
        return {"goal": goal, "collision": collision, "dcpa": self._dcpa}

    def _prepare(self) -> None:
        self._surface = pygame.Surface((scene.SIZE, scene.SIZE), depth=32)
        self._luminance = np.array(scene.LUMINANCE, np.float32)

    def _moving(self) -> tuple[tuple[float, float], list[list[tuple[float, float]]]]:
        """End of the line and corners of the target ships, in pixels.

        Own ship in the middle, heading up; pixel k lies between k and k + 1, its centre at k + 0.5.
        """
        turn = math.pi / 2 - self._heading
        cos, sin = math.cos(turn), math.sin(turn)
        scale, middle = scene.PIXELS_PER_METRE, scene.SIZE / 2 - 0.5
        gx, gy = (self._case.goal[0] - self._x) * scale, (self._case.goal[1] - self._y) * scale
        end = (middle + gx * cos - gy * sin, middle - gx * sin - gy * cos)
        time, ships = self._time * self._world.dt, []
        for sx, sy, vx, vy, course in self._ships:
            ex, ey = (sx + time * vx - self._x) * scale, (sy + time * vy - self._y) * scale
            px, py = middle + ex * cos - ey * sin, middle - ex * sin - ey * cos
            c, s = math.cos(course + turn), math.sin(course + turn)
            ships.append([(px + u * c - v * s, py - u * s - v * c) for u, v in self._outline])
        return end, ships

    def _draw(self) -> NDArray[np.uint8]:
        surface, world, middle = self._surface, self._world, scene.SIZE / 2 - 0.5
        end, ships = self._moving()
        surface.fill(scene.OUTSIDE)
        for radius, colour in (
            (scene.WINDOW, scene.DISC),
            (world.goal_distance, scene.GOAL_CIRCLE),
            (world.safe_distance, scene.SAFE_CIRCLE),
        ):
            pygame.draw.circle(surface, colour, (middle + 0.5, middle + 0.5), radius * scene.PIXELS_PER_METRE)
        outline = scene.ship_outline(scene.OWN_LENGTH)
        scale = scene.PIXELS_PER_METRE
        pygame.draw.polygon(
            surface, scene.OWN, [(middle - v * scale, middle - u * scale) for u, v in outline]
        )
        pygame.draw.aaline(surface, scene.LINE, (middle, middle), end)
        for corners in ships:
            pygame.draw.polygon(surface, scene.TARGET, corners)
            pygame.draw.aalines(surface, scene.TARGET, True, corners)
        bright = pygame.surfarray.array3d(surface) @ self._luminance
        return np.ascontiguousarray(bright.T.astype(np.uint8))[None]


class TunedPygameShipEnv(PygameShipEnv):
    """The quickest picture that pygame gave: a copied background, hard edges, one byte a pixel."""

    def _prepare(self) -> None:
        self._background = still_picture(self._world)
        # pygame draws right into the array's memory: no copy out of a surface.
        memory = bytearray(self._background.tobytes())
        self._pixels = np.frombuffer(memory, np.uint8).reshape(self._background.shape)
        self._surface = pygame.image.frombuffer(memory, (scene.SIZE, scene.SIZE), "P")
        self._line, self._green = grey(scene.LINE), grey(scene.TARGET)

    def _draw(self) -> NDArray[np.uint8]:
        np.copyto(self._pixels, self._background)
        end, ships = self._moving()
        middle = round(scene.SIZE / 2 - 0.5)
        pygame.draw.line(self._surface, self._line, (middle, middle), (round(end[0]), round(end[1])))
        for corners in ships:
            pygame.draw.polygon(self._surface, self._green, [(round(x), round(y)) for x, y in corners])
        return self._pixels[None].copy()
