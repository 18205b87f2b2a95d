"""Action masks, by TorchRL's key: bool [N, A] says which actions each row allows. Without it all are."""

from __future__ import annotations

from collections.abc import Callable

import torch
from tensordict import TensorDictBase
from torch import Tensor

ACTION_MASK = "action_mask"
# Maps states [N, S] to the allowed actions, bool [N, A]; at least one in each row.
Mask = Callable[[Tensor], Tensor]


def mask_values(values: Tensor, allowed: Tensor | None) -> Tensor:
    """Return values of actions [..., A], with minus infinity for those that are not allowed."""
    return values if allowed is None else values.masked_fill(~allowed, -torch.inf)


def mask_of(step: TensorDictBase) -> Tensor | None:
    """Return the allowed actions of a step, if it says which."""
    allowed: Tensor | None = step.get(ACTION_MASK, None)
    return allowed
