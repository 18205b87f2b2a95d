"""Loops compiled by numba."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

Loop = Callable[..., Any]

# The last bit may be rounded differently (fused multiply-add), and zeros have no sign.
RELAXED = {"contract", "nsz"}
# Lets the compiler assume that no value is NaN, so that `min` and `max` are single instructions.
NO_NAN = RELAXED | {"nnan"}


def compiled(fastmath: set[str] | bool = False) -> Callable[[Loop], Loop]:
    """Compile a function at its first call, and cache the result for later processes if a folder is writable.

    numba notices a change of the loop's own file, but not of this one: after editing it, delete the caches.
    Division by zero behaves as in NumPy, because a check would prevent vectorised loops. `fastmath` names
    LLVM's flags that relax rounding.
    """

    def decorate(function: Loop) -> Loop:
        try:
            return njit(cache=True, fastmath=fastmath, error_model="numpy")(function)
        except RuntimeError:  # no writable folder for a cache
            return njit(fastmath=fastmath, error_model="numpy")(function)

    return decorate
