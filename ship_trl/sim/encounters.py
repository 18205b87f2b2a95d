"""The classes of encounter that the steering rules tell apart, by Pedersen's sectors.

Bearings are clockwise from the bow in radians, starboard positive, as the rules count them.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, TypeVar

from numpy.typing import NDArray
from torch import Tensor

Angles = TypeVar("Angles", Tensor, NDArray[Any])

# Rule 13: a ship that comes up from more than 22.5 degrees abaft the beam overtakes.
ABAFT_BEAM = math.radians(112.5)
# Pedersen 2023: the overtaken ship is at most this far off the overtaker's bow.
AHEAD = math.radians(67.5)
# Pedersen's half-angle (degrees) of the head-on sector.
HEAD_ON = 5.0


class Encounter(IntEnum):
    """What the rules ask of own ship towards one target ship."""

    NONE = 0
    HEAD_ON = 1
    GIVE_WAY = 2
    STAND_ON = 3
    OVERTAKING = 4
    OVERTAKEN = 5


def classify(bearing: Angles, aspect: Angles, head_on: float) -> Angles:
    """Return encounter classes by Pedersen's sectors (2023, as in DNV's traffic generator), int64 [...].

    The sectors say what the rules would ask, not whether there is a risk of collision.

    Args:
        bearing: of the target ship from own ship, clockwise (rad) [...]; a tensor or an array.
        aspect: bearing of own ship from the target ship, likewise.
        head_on: half-angle (rad) of the head-on sector.
    """

    def crosses(one: Angles, other: Angles) -> Angles:
        """Whether a ship has the other on its starboard side, by the bearings from either."""
        return (one > 0) & (one < ABAFT_BEAM) & (other > -ABAFT_BEAM) & (other <= head_on)

    meets = (abs(bearing) <= head_on) & (abs(aspect) <= head_on)
    gives_way = crosses(bearing, aspect) & ~meets
    return (
        Encounter.HEAD_ON * meets
        + Encounter.GIVE_WAY * gives_way
        + Encounter.STAND_ON * (crosses(aspect, bearing) & ~meets & ~gives_way)
        + Encounter.OVERTAKING * ((abs(aspect) > ABAFT_BEAM) & (abs(bearing) < AHEAD))
        + Encounter.OVERTAKEN * ((abs(bearing) > ABAFT_BEAM) & (abs(aspect) < AHEAD))
    )
