"""A strip below a picture of the scene: a scale bar, what is what, and that hulls are larger than life."""

from __future__ import annotations

from PIL import Image, ImageDraw

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.view.lettering import FAINT, INK, PAPER, font

HEIGHT = 26
# Metres of the scale bar.
BAR = 200.0
SIZE = 11


def draw_legend(width: int, side: int, world: World) -> Image.Image:
    """Draw the strip in RGB, `width` x `HEIGHT` pixels.

    Args:
        width: in pixels; 800 hold everything.
        side: pixels of a side of the pictures that it explains; they show 2 x `scene.WINDOW` metres.
        world: its safe and expected distance.
    """
    strip = Image.new("RGB", (width, HEIGHT), PAPER)
    pen, middle, x = ImageDraw.Draw(strip), HEIGHT // 2, 14.0
    length = BAR * side / (2 * scene.WINDOW)
    pen.line((x, middle, x + length, middle), INK)
    for end in (x, x + length):
        pen.line((end, middle - 4, end, middle + 4), INK)
    x = _words(pen, x + length + 6, f"{BAR:g} m", INK)
    for colour, outline, words in (
        (scene.OWN, True, "own ship"),
        (scene.TARGET, True, "target ship"),
        (scene.GOAL_CIRCLE, False, f"expected distance {world.goal_distance:g} m"),
        (scene.SAFE_CIRCLE, False, f"safe distance {world.safe_distance:g} m"),
    ):
        if outline:
            # North is up, and so is the bow.
            corners = [(x + 5 - v, middle - u) for u, v in scene.ship_outline(13.0)]
            pen.polygon(corners, colour)
        else:
            pen.ellipse((x, middle - 5, x + 10, middle + 5), colour, outline=FAINT)
        x = _words(pen, x + 16, words, INK)
    pen.line((x, middle + 4, x + 12, middle - 4), scene.LINE)
    x = _words(pen, x + 18, "to the goal", INK)
    _words(pen, x, "hulls larger than life", FAINT)
    return strip


def _words(pen: ImageDraw.ImageDraw, x: float, words: str, colour: tuple[int, int, int]) -> float:
    """Write words; returns where the next thing begins."""
    pen.text((x, HEIGHT // 2), words, colour, font(SIZE), anchor="lm")
    return float(x + font(SIZE).getlength(words) + 14)
