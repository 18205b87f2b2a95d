"""The classes of encounter that the steering rules tell apart, by Pedersen's sectors.

Bearings are clockwise from the bow in radians, starboard positive, as the rules count them.
"""

from __future__ import annotations

import math
from enum import IntEnum

import torch
from torch import Tensor

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


def classify(bearing: Tensor, aspect: Tensor, head_on: float) -> Tensor:
    """Return encounter classes by Pedersen's sectors (2023, as in DNV's traffic generator), int64 [...].

    The sectors say what the rules would ask, not whether there is a risk of collision.

    Args:
        bearing: of the target ship from own ship, clockwise (rad) [...].
        aspect: bearing of own ship from the target ship, likewise.
        head_on: half-angle (rad) of the head-on sector.
    """

    def crosses(one: Tensor, other: Tensor) -> Tensor:
        """Whether a ship has the other on its starboard side, by the bearings from either."""
        return (one > 0) & (one < ABAFT_BEAM) & (other > -ABAFT_BEAM) & (other <= head_on)

    classes = torch.full_like(bearing, Encounter.NONE, dtype=torch.int64)
    classes[crosses(aspect, bearing)] = Encounter.STAND_ON
    classes[crosses(bearing, aspect)] = Encounter.GIVE_WAY
    classes[(bearing.abs() <= head_on) & (aspect.abs() <= head_on)] = Encounter.HEAD_ON
    classes[(bearing.abs() > ABAFT_BEAM) & (aspect.abs() < AHEAD)] = Encounter.OVERTAKEN
    classes[(aspect.abs() > ABAFT_BEAM) & (bearing.abs() < AHEAD)] = Encounter.OVERTAKING
    return classes
