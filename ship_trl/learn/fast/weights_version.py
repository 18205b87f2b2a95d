"""Tokens that tell whether weights may have changed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from torch import Tensor
from torch.optim.optimizer import register_optimizer_step_post_hook

# Steps of all optimisers in this process: fused optimisers change weights, but not their `_version`.
_optimiser_steps = 0
# Writes to `parameter.data`, as in loading and moving: they leave `_version` unchanged too.
_untracked_writes = 0


def _count_optimiser_step(*_: Any) -> None:
    global _optimiser_steps
    _optimiser_steps += 1


register_optimizer_step_post_hook(_count_optimiser_step)


def count_untracked_write(*_: Any) -> None:
    """Record a write to `weight.data`; tokens made before it become stale."""
    global _untracked_writes
    _untracked_writes += 1


def untracked_writes() -> int:
    """Return how often `count_untracked_write` was called."""
    return _untracked_writes


def weights_version(weights: Iterable[Tensor], learning: bool = True) -> tuple[int, ...]:
    """Return a token that changes when the weights may have changed.

    `learning` tells whether an optimiser step may change them. Inference tensors count as unchanged.
    """
    versions = (-1 if weight.is_inference() else weight._version for weight in weights)  # noqa: SLF001
    return (_optimiser_steps if learning else 0, _untracked_writes, *versions)
