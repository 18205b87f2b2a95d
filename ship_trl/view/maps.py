"""Draw episodes as maps alone, with words that are readable at the width of a phone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pygame

from ship_trl.sim import scene
from ship_trl.view import pen
from ship_trl.view.episode import EpisodeView
from ship_trl.view.painter import map_frame, paint_scene
from ship_trl.view.style import BACKGROUND, CHOSEN, DANGER, FAINT, OUTCOMES, TEXT, action_text, blend

# Letters in a row of a picture of one map or of many, pixels between maps, and heights in letters below them.
ONE, MANY, GAP, ACTIONS, LINE = 34, 40, 8, 3.2, 1.5


def draw_maps(surface: pygame.Surface, views: Sequence[EpisodeView], position: float) -> None:
    """Fill a surface with a map of each episode at a position in steps; below a single one are actions."""
    (width, height), count = surface.get_size(), len(views)
    # Policies of one case have their own names, and one scale.
    is_compared = count > 1 and len({view.case.name for view in views}) == 1
    size = width // (ONE if count == 1 else MANY)
    below = round(size * (LINE + (ACTIONS if count == 1 else 1.3 * LINE)))

    def side_of(columns: int) -> int:
        return min(width // columns, height // math.ceil(count / columns) - below) - GAP

    columns = max(range(1, count + 1), key=side_of)
    side = side_of(columns)
    surface.fill(BACKGROUND)
    for k, view in enumerate(views):
        numbers, sea = view.telemetry, view.case.scale
        # A step that has begun counts as begun.
        step = min(int(position + 1e-9), numbers.steps)
        left = round((k % columns + 0.5) * width / columns - side / 2)
        place = pygame.Rect(left, k // columns * (side + below + GAP) + GAP // 2, side, side)
        ways = [scene.OWN, *[scene.TARGET] * numbers.ships.shape[1]]
        frame = map_frame([one.telemetry for one in views] if is_compared else [numbers], side)
        paint_scene(surface.subsurface(place), numbers, position, frame, ways=ways, sea=sea)
        room = pygame.Rect(left, place.bottom + 0.3 * size, side, below)
        words = [(TEXT, f"case {view.case.name}")] if count == 1 else []
        least = float(numbers.closest[step].min(initial=math.inf))
        if least < math.inf:
            told = f"{least:.0f} m" if sea is None else f"{least:.0f} m, {sea.miles(least)}"
            told = f"closest so far {told}" if count == 1 else told
            words.append((DANGER if least < numbers.world.safe_distance else FAINT, told))
        if position >= numbers.steps and numbers.outcome is not None:
            words.append((OUTCOMES[numbers.outcome], numbers.outcome))
        if count > 1:
            name = pen.cut(view.title if is_compared else view.case.name, side, size)
            pen.write(surface, name, (left, room.top + 0.95 * size), TEXT, size)
            room.top += round(LINE * size)
        bottom = pen.flow(surface, words, room, size)
        if count == 1:
            _draw_actions(surface, pygame.Rect(left, bottom, side, ACTIONS * size), view, step, size)


def _draw_actions(
    surface: pygame.Surface, room: pygame.Rect, view: EpisodeView, step: int, size: int
) -> None:
    """Draw a box for each action, with its turn (rad/s) and speed; the chosen one is bright."""
    world, chosen, sea = view.telemetry.world, view.telemetry.action(step), view.case.scale
    pitch = room.width / len(world.actions)
    for k in range(len(world.actions)):
        box = pygame.Rect(room.left + k * pitch + 2, room.top, pitch - 4, room.height)
        colour = CHOSEN if k == chosen else FAINT
        pygame.draw.rect(
            surface, blend(colour, BACKGROUND, 0.3 if k == chosen else 0.1), box, border_radius=6
        )
        speed, turn = action_text(world, k).split(" m/s ")
        told = f"{speed} m/s" if sea is None else sea.knots(world.actions[k][0])
        for line, words in enumerate((turn, told)):
            at = box.centerx, box.top + (0.3 + 0.42 * line) * box.height
            pen.write(surface, words, at, colour, size, k == chosen and not line, across=0.5)
