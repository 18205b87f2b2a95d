"""The same world in plain Python numbers, pygame and Gymnasium.

`PygameShipEnv` draws as most people would. `TunedPygameShipEnv` draws only what moves, with hard edges,
into bytes. They share constants with the simulator but no code, so that a test can compare the two worlds.
Positions, velocities and offsets in the picture are complex numbers: x + iy.
"""

from __future__ import annotations

import cmath
import math
import os
from collections.abc import Sequence
from itertools import cycle
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from benchmarks.ours import FRAME
from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame

# Positions are rounded, so the goal counts as reached from a millimetre farther off.
GOAL_TOLERANCE = 1e-3
# The background is drawn this many times larger and then smoothed.
OVERSAMPLING = 4
Pixel = tuple[float, float]


def to_grey(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return how bright colours look: [..., 3] to [...]."""
    bright: NDArray[np.uint8] = (rgb @ np.array(scene.LUMINANCE, np.float32) + 0.5).astype(np.uint8)
    return bright


def read_grey(surface: pygame.Surface) -> NDArray[np.uint8]:
    """Return a surface in grey, with rows first."""
    return np.ascontiguousarray(to_grey(pygame.surfarray.array3d(surface)).T)


def to_pixel(offset: complex, size: int = scene.SIZE) -> Pixel:
    """Return the pixel at an offset to the right (real) and ahead (imaginary) of the middle, in pixels."""
    return size / 2 - 0.5 + offset.real, size / 2 - 0.5 - offset.imag


def draw_still(surface: pygame.Surface, world: World) -> None:
    """Draw what never moves when the own ship stays in the middle and heads up."""
    size = surface.get_width()
    scale = scene.PIXELS_PER_METRE * size / scene.SIZE
    surface.fill(scene.OUTSIDE)
    for radius, colour in (
        (scene.VIEW_RADIUS, scene.DISC),
        (world.goal_distance, scene.GOAL_CIRCLE),
        (world.safe_distance, scene.SAFE_CIRCLE),
    ):
        pygame.draw.circle(surface, colour, (size / 2, size / 2), radius * scale)
    corners = [to_pixel(1j * scale * complex(u, v), size) for u, v in scene.ship_outline(scene.OWN_LENGTH)]
    pygame.draw.polygon(surface, scene.OWN, corners)


class PygameShipEnv(gymnasium.Env[NDArray[np.uint8], np.int64]):
    """One own ship; observation uint8 [1, 84, 84], the actions of table 1, raw rewards.

    Each episode is of the next case, and after the last one of the first again.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium declares it on the instance)

    def __init__(self, cases: Sequence[Case], world: World) -> None:
        self.observation_space = spaces.Box(0, 255, FRAME, np.uint8)
        self.action_space = spaces.Discrete(len(world.actions))
        self._cases, self._world = cycle(cases), world
        outline = scene.ship_outline(scene.TARGET_LENGTH)
        self._outline = [scene.PIXELS_PER_METRE * complex(u, v) for u, v in outline]
        self._prepare()

    def _start(self, case: Case) -> None:
        self._place, self._heading = complex(*case.start), math.radians(case.heading)
        self._goal = complex(*case.goal)
        self._targets = [
            (complex(ship.x, ship.y), cmath.rect(ship.speed, course), course)
            for ship in case.target_ships
            for course in [math.radians(ship.heading)]
        ]
        self._steps, self._dcpa = 0, math.inf

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        self._start(next(self._cases))
        return self._draw(), {}

    def step(self, action: np.int64) -> tuple[NDArray[np.uint8], float, bool, bool, dict[str, Any]]:
        """Turn, then move for one second."""
        world, dt = self._world, self._world.dt
        speed, turn = world.actions[action]
        before, time = self._place, self._steps * dt
        self._heading += turn * dt
        self._place += cmath.rect(speed * dt, self._heading)
        self._steps += 1
        nearest = math.inf
        for start, velocity, _ in self._targets:
            # Relative to the own ship, a target ship moves on a straight line within the step.
            away = start + time * velocity - before
            moved = start + (time + dt) * velocity - self._place - away
            length2 = abs(moved) ** 2
            share = -(away * moved.conjugate()).real / length2 if length2 > 0 else 0.0
            nearest = min(nearest, abs(away + min(1.0, max(0.0, share)) * moved))
        self._dcpa = min(self._dcpa, nearest)
        collision = nearest < world.safe_distance
        distance, bearing = cmath.polar(self._goal - self._place)
        goal = not collision and distance <= world.goal_distance + GOAL_TOLERANCE
        off_bow = math.degrees(math.remainder(bearing - self._heading, math.tau))
        weights = world.reward
        reward = weights.w3 * weights.k1 * distance + weights.w4 * weights.k2 * abs(off_bow)
        if goal:
            reward += weights.w1 * weights.goal
        elif collision:
            reward += weights.w2 * weights.collision
        terminated = goal or collision
        truncated = self._steps >= world.max_steps and not terminated
        info = {"goal": goal, "collision": collision, "least_distance": self._dcpa}
        return self._draw(), reward, terminated, truncated, info

    def _moving(self) -> tuple[Pixel, list[list[Pixel]]]:
        """Return the end of the line to the goal, and the corners of every target ship."""
        turn = math.pi / 2 - self._heading
        scale = cmath.rect(scene.PIXELS_PER_METRE, turn)
        time, ships = self._steps * self._world.dt, []
        for start, velocity, course in self._targets:
            middle = (start + time * velocity - self._place) * scale
            rotation = cmath.rect(1.0, course + turn)
            ships.append([to_pixel(middle + corner * rotation) for corner in self._outline])
        return to_pixel((self._goal - self._place) * scale), ships

    def _prepare(self) -> None:
        self._surface = pygame.Surface((scene.SIZE, scene.SIZE), depth=32)

    def _draw(self) -> NDArray[np.uint8]:
        end, ships = self._moving()
        draw_still(self._surface, self._world)
        pygame.draw.aaline(self._surface, scene.LINE, to_pixel(0), end)
        for corners in ships:
            pygame.draw.polygon(self._surface, scene.TARGET, corners)
            pygame.draw.aalines(self._surface, scene.TARGET, True, corners)
        return read_grey(self._surface)[None]


class TunedPygameShipEnv(PygameShipEnv):
    """The fastest picture that we got from pygame: a copied background, hard edges, one byte a pixel."""

    def _prepare(self) -> None:
        large = pygame.Surface((scene.SIZE * OVERSAMPLING,) * 2, depth=32)
        draw_still(large, self._world)
        self._background = read_grey(pygame.transform.smoothscale(large, (scene.SIZE, scene.SIZE)))
        # pygame draws into the array's own memory, so that no surface is copied.
        memory = bytearray(self._background.tobytes())
        self._pixels = np.frombuffer(memory, np.uint8).reshape(self._background.shape)
        self._surface = pygame.image.frombuffer(memory, (scene.SIZE, scene.SIZE), "P")
        self._line, self._target = to_grey(np.array([scene.LINE, scene.TARGET], np.uint8)).tolist()

    def _draw(self) -> NDArray[np.uint8]:
        np.copyto(self._pixels, self._background)
        end, ships = self._moving()
        middle = scene.SIZE // 2
        pygame.draw.line(self._surface, self._line, (middle, middle), (round(end[0]), round(end[1])))
        for corners in ships:
            pygame.draw.polygon(self._surface, self._target, [(round(x), round(y)) for x, y in corners])
        return self._pixels[None].copy()
