"""Tokens that tell whether weights may have changed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from torch import Tensor
from torch.optim.optimizer import register_optimizer_step_post_hook

# Steps of all optimisers in this process. Fused optimisers change weights, but not their `_version`.
_steps = 0
# How often weights were loaded or moved: tensordict writes to `parameter.data`, so `_version` stays.
_rewrites = 0


def _count_step(*_: Any) -> None:
    global _steps
    _steps += 1


register_optimizer_step_post_hook(_count_step)


def count_rewrite(*_: Any) -> None:
    """Record a write to weights that leaves their `_version` unchanged."""
    global _rewrites
    _rewrites += 1


def rewrites() -> int:
    """Return how often `count_rewrite` was called."""
    return _rewrites


def version(weights: Iterable[Tensor], learning: bool = True) -> tuple[int, ...]:
    """Return a token that changes when the weights may have changed.

    After a write to `weight.data`, call `count_rewrite`: the token cannot see the write itself.

    Args:
        weights: any tensors; inference tensors have no version and count as unchanged.
        learning: whether an optimiser step may change them.
    """
    versions = (-1 if weight.is_inference() else weight._version for weight in weights)  # noqa: SLF001
    return (_steps if learning else 0, _rewrites, *versions)
