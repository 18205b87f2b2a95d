"""Sizes (m) and colours (RGB) of the picture, for the network's view and for people.

The paper gives the elements (figure 1); sizes and colours are our choice.
"""

from __future__ import annotations

import math

from ship_trl.config.bounds import PICTURE

# Width and height of the network's view in pixels.
SIZE = PICTURE
# Radius in metres of the visible disc around own ship: half the picture's width.
VIEW_RADIUS = 640.0
PIXELS_PER_METRE = SIZE / (2 * VIEW_RADIUS)

OUTSIDE = (92, 122, 150)
DISC = (26, 38, 58)
GOAL_CIRCLE = (205, 45, 45)
SAFE_CIRCLE = (0, 0, 0)
OWN = (255, 255, 255)
LINE = (235, 235, 235)
TARGET = (60, 220, 90)
# Weights of red, green and blue in grey (ITU-R BT.601).
LUMINANCE = (0.299, 0.587, 0.114)

# Pixels.
LINE_WIDTH = 1.0
# Metres.
OWN_LENGTH = 76.0
# Metres: 7.2 pixels in the network's view. At least 6 are needed.
TARGET_LENGTH = 110.0


def ship_outline(length: float) -> list[tuple[float, float]]:
    """Return the corners (m) of a ship with its bow along +x, counter-clockwise, with a flat stern."""
    beam = 0.45 * length
    return [
        (0.5 * length, 0.0),
        (-0.1 * length, 0.5 * beam),
        (-0.5 * length, 0.5 * beam),
        (-0.5 * length, -0.5 * beam),
        (-0.1 * length, -0.5 * beam),
    ]


def patch_size() -> int:
    """Return the width in pixels of a square that holds a target ship at any heading, with blurred edges."""
    radius = max(math.hypot(*corner) for corner in ship_outline(TARGET_LENGTH)) * PIXELS_PER_METRE
    # One pixel for blur, and one for rounding the square's position to whole pixels.
    return math.ceil(2 * radius) + 2
