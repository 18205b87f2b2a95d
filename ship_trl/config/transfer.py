"""Settings of the methods of transfer that have some; conf/config.yaml says what each key means. No torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

from pydantic import Field

from ship_trl.config.bounds import MAX_COUNT, PositiveShare, Share

# Weight of a part of the loss.
Weight = Annotated[float, Field(ge=0, le=1e9)]


class GuideSchedule(StrEnum):
    """How the probability of the source's action falls: over training or over the steps of an episode."""

    belief = "belief"
    reuse = "reuse"
    jumpstart = "jumpstart"


@dataclass(frozen=True)
class Guide:
    """When the source chooses the action."""

    schedule: GuideSchedule = GuideSchedule.belief
    belief: Share = 0.9
    period: PositiveShare = 0.2
    decay: Share = 0.95
    steps: Annotated[int, Field(ge=1, le=MAX_COUNT)] = 20


@dataclass(frozen=True)
class L2SP:
    """How strongly weights are pulled: copied ones to the source's, fresh ones to zero; how fast they learn.

    The learning rate of a copied layer is that of the layer above it, divided by `rate_decay`.
    """

    copied: Weight = 0.01
    fresh: Weight = 0.0
    rate_decay: Annotated[float, Field(ge=1, le=1000)] = 1.0


@dataclass(frozen=True)
class QDagger:
    """How strongly the policy is pulled to the source's."""

    weight: Weight = 3.0
    temperature: Annotated[float, Field(gt=0, le=1e6)] = 1.0


@dataclass(frozen=True)
class Unfreeze:
    """When copied layers thaw."""

    period: PositiveShare = 0.5


@dataclass(frozen=True)
class Transfer:
    """Settings by method."""

    guide: Guide = field(default_factory=Guide)
    l2sp: L2SP = field(default_factory=L2SP)
    qdagger: QDagger = field(default_factory=QDagger)
    unfreeze: Unfreeze = field(default_factory=Unfreeze)
