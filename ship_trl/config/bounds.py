"""The bounds of single values of the configuration.

Bounds lie far above what a run needs: beyond them it would not fit into memory, or its numbers into 32 bits.
"""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import Field

from ship_trl.config.paths import MAX_PATH_BYTES, MAX_PATH_NAME_BYTES, is_path
from ship_trl.config.schema import MAX_INTEGER, rule

# m/s, and metres.
KNOT, NAUTICAL_MILE = 1852 / 3600, 1852.0
# Side in pixels of the picture that the network sees.
PICTURE = 84
# Numbers in the vector that it sees: of own ship, of each target ship, and of their encounter.
OWN_NUMBERS, SHIP_NUMBERS, ENCOUNTER_NUMBERS = 5, 10, 9
# Episodes and steps only take time: a run of a billion would take years.
MAX_COUNT, MAX_DRAWS = 10**9, 10**6
# At this number of steps the planner's table of returns takes 2.3 GB.
MAX_STEPS, MAX_ACTIONS = 1000, 100
# Seconds of a step; m/s of own ship; metres of a radius or a coordinate.
MIN_STEP_SECONDS, MAX_STEP_SECONDS, MAX_SPEED, MAX_DISTANCE = 1e-3, 1e3, 1e3, 1e5
MAX_REWARD_COEFFICIENT = 1e6
# Adam's steps are about as large as the learning rate.
MAX_LEARNING_RATE, MAX_REWARD_SCALE, MAX_HUBER_DELTA = 1.0, 1e3, 1e9
# Filters of a layer, and hidden units; target ships that a network sees as numbers.
MAX_UNITS, MAX_SHIPS = 4096, 100

Seed = Annotated[int, Field(ge=0, le=MAX_INTEGER)]
Positive = Annotated[int, Field(ge=1, le=MAX_INTEGER)]
Count = Annotated[int, Field(ge=1, le=MAX_COUNT)]
Share = Annotated[float, Field(ge=0, le=1)]
PositiveShare = Annotated[float, Field(gt=0, le=1)]
LearningRate = Annotated[float, Field(gt=0, le=MAX_LEARNING_RATE)]
# Weight of a part of the loss.
LossWeight = Annotated[float, Field(ge=0, le=1e9)]
RewardScale = Annotated[float, Field(gt=0, le=MAX_REWARD_SCALE)]
# Default half-angle of the head-on sector (Pedersen 2023).
HEAD_ON_DEGREES = 5.0
# The steering rules that are scored, in the order of tables and tensors.
RULES = (8, 13, 14, 15, 16, 17)
HalfAngle = Annotated[float, Field(gt=0, le=90)]
Metres = Annotated[float, Field(gt=0, le=MAX_DISTANCE)]
Bound = Annotated[float, Field(ge=0, le=MAX_DISTANCE)]
Range = Annotated[
    list[Bound],
    rule("[least, most], two numbers in order", lambda ends: len(ends) == 2 and ends[0] <= ends[1]),
]
ShipShares = rule(
    "the shares of scenes with 0, 1, 2, ... ships, for at most 8 ships, not all zero",
    lambda shares: 1 <= len(shares) <= 9 and sum(shares) > 0,
)
Seconds = Annotated[float, Field(ge=0, le=MAX_STEP_SECONDS)]
Coefficient = Annotated[float, Field(ge=-MAX_REWARD_COEFFICIENT, le=MAX_REWARD_COEFFICIENT)]
Bonus = Annotated[float, Field(ge=0, le=MAX_REWARD_COEFFICIENT)]
Penalty = Annotated[float, Field(ge=-MAX_REWARD_COEFFICIENT, le=0)]
PathName = Annotated[
    str, rule(f"a path of at most {MAX_PATH_BYTES} bytes, {MAX_PATH_NAME_BYTES} a name", is_path)
]
FolderName = Annotated[
    PathName, rule("the name of a folder", lambda name: "/" not in name and name not in (".", ".."))
]
Device = Annotated[
    str, rule("cpu or cuda", lambda name: re.fullmatch(r"cpu|cuda(:\d{1,3})?", name, re.ASCII) is not None)
]
ConvNumbers = Annotated[
    list[int],
    rule(
        f"[filters, kernel, stride], each at least 1, at most {MAX_UNITS} filters",
        lambda numbers: len(numbers) == 3 and min(numbers) >= 1 and numbers[0] <= MAX_UNITS,
    ),
]
Actions = Annotated[
    list[list[float]],
    rule(
        f"at most {MAX_ACTIONS} of [v in m/s, omega in rad/s], |v| at most {MAX_SPEED:g}, one v above 0",
        lambda rows: (
            len(rows) <= MAX_ACTIONS
            and all(len(row) == 2 and abs(row[0]) <= MAX_SPEED for row in rows)
            and any(speed > 0 for speed, _ in rows)
        ),
    ),
]
