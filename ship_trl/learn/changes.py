"""Whether weights may have changed since they were last looked at."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from torch import Tensor
from torch.optim.optimizer import register_optimizer_step_post_hook

# Steps of all optimisers in this process: fused ones change weights without counting a version up.
_steps = 0


def _count(*_: Any) -> None:
    global _steps
    _steps += 1


register_optimizer_step_post_hook(_count)


def version(weights: Iterable[Tensor]) -> tuple[int, ...]:
    """Return numbers that are others after an optimiser's step, or after a change in place.

    What goes around both, as writing to `weight.data`, is not seen.
    """
    return (_steps, *(weight._version for weight in weights))  # noqa: SLF001
