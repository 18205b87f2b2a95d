"""The world: physics and reward, which all cases share. Its values are in conf/world."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any

from omegaconf import OmegaConf
from pydantic import Field

from ship_trl.config.bounds import (
    MAX_STEP_SECONDS,
    MAX_STEPS,
    MAX_TURN,
    MIN_STEP_SECONDS,
    Actions,
    Bound,
    Coefficient,
    Metres,
    Seconds,
)


@dataclass
class Reward:
    """Constants of equations 4 to 6."""

    goal: Coefficient
    collision: Coefficient
    w1: Coefficient
    w2: Coefficient
    w3: Coefficient
    w4: Coefficient
    k1: Coefficient
    k2: Coefficient


@dataclass(frozen=True)
class GiveWay:
    """When and how sharply a target ship gives way, if that is its behaviour (`sim.transition.give_way`).

    It gives way to own ship if they would pass at less than `dcpa` metres in at most `tcpa` seconds, and
    turns at `turn` rad/s.
    """

    tcpa: Seconds = 20.0
    dcpa: Bound = 90.0
    turn: Annotated[float, Field(ge=0, le=MAX_TURN)] = 0.05


@dataclass
class World:
    """The physics shared by all cases (sections 3.1 and 3.3); the defaults are the paper's.

    `turn_time` and `speed_time` are the time constants with which own ship's yaw rate and speed follow an
    action; 0 is at once.
    """

    dt: Annotated[float, Field(ge=MIN_STEP_SECONDS, le=MAX_STEP_SECONDS)]
    max_steps: Annotated[int, Field(ge=1, le=MAX_STEPS)]
    safe_distance: Metres
    goal_distance: Metres
    actions: Actions
    reward: Reward
    turn_time: Seconds = 0.0
    speed_time: Seconds = 0.0
    give_way: GiveWay = GiveWay()

    @property
    def straight_action(self) -> int:
        """Index of the action that turns least; of several, the fastest."""
        return min(range(len(self.actions)), key=lambda k: (abs(self.actions[k][1]), -self.actions[k][0]))


def world_values(world: World) -> dict[str, Any]:
    """Return a world as plain values for a digest.

    Keys that came later are left out at their default, so that digests of older worlds stay the same.
    """
    defaults = {one.name: one.default for one in dataclasses.fields(World)}
    values: Any = OmegaConf.to_container(OmegaConf.structured(world), enum_to_str=True)
    return {key: value for key, value in values.items() if getattr(world, key) != defaults[key]}
