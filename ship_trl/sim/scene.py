"""What the picture shows, in metres and RGB: shared by the network's view and the people's.

The paper's figure 1 gives the elements; sizes and colours are our choice.
"""

from __future__ import annotations

import math

from ship_trl.config.types import PICTURE

SIZE = PICTURE
WINDOW = 640.0
PIXELS_PER_METRE = SIZE / (2 * WINDOW)

OUTSIDE = (92, 122, 150)
DISC = (26, 38, 58)
GOAL_CIRCLE = (205, 45, 45)
SAFE_CIRCLE = (0, 0, 0)
OWN = (255, 255, 255)
LINE = (235, 235, 235)
TARGET = (60, 220, 90)
# ITU-R BT.601: how bright a colour looks in grey.
LUMINANCE = (0.299, 0.587, 0.114)

LINE_WIDTH = 1.0
OWN_LENGTH = 76.0
# At least 6 pixels long for the network: 7.2 pixels.
TARGET_LENGTH = 110.0


def ship_outline(length: float) -> list[tuple[float, float]]:
    """Corners (m) of a ship with its bow along +x, counter-clockwise: a flat stern, a long bow."""
    beam = 0.45 * length
    return [
        (0.5 * length, 0.0),
        (-0.1 * length, 0.5 * beam),
        (-0.5 * length, 0.5 * beam),
        (-0.5 * length, -0.5 * beam),
        (-0.1 * length, -0.5 * beam),
    ]


def patch_size() -> int:
    """Pixels across the square that holds a target ship in any direction, edges blurred."""
    reach = max(math.hypot(*corner) for corner in ship_outline(TARGET_LENGTH)) * PIXELS_PER_METRE
    # One pixel of blur, and one for rounding the square to whole pixels.
    return math.ceil(2 * reach) + 2
