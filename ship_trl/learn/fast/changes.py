"""Whether weights may have changed since they were last looked at."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from torch import Tensor
from torch.optim.optimizer import register_optimizer_step_post_hook

# Steps of all optimisers in this process: fused ones change weights without counting a version up.
_steps = 0
# Times that a loss was loaded or moved: tensordict writes to the data of parameters, which counts nothing up.
_rewrites = 0


def _count_step(*_: Any) -> None:
    global _steps
    _steps += 1


register_optimizer_step_post_hook(_count_step)


def count_rewrite(*_: Any) -> None:
    """Say that weights were written to in a way that no version tells."""
    global _rewrites
    _rewrites += 1


def rewrites() -> int:
    """Return how often weights were written to so."""
    return _rewrites


def version(weights: Iterable[Tensor], learning: bool = True) -> tuple[int, ...]:
    """Return numbers that are others after weights may have changed.

    What goes around optimisers, changes in place and `count_rewrite`, as writing to `weight.data`, is not
    seen.

    Args:
        weights: or other tensors; those of inference mode have no version, and count as the same.
        learning: whether an optimiser's step may change them.
    """
    versions = (-1 if weight.is_inference() else weight._version for weight in weights)  # noqa: SLF001
    return (_steps if learning else 0, _rewrites, *versions)
