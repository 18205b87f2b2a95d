"""Loops compiled by numba."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

Loop = Callable[..., Any]

# Rounding may differ in the last bit (fused multiply-add), and zeros have no sign.
RELAXED = {"contract", "nsz"}


def compiled(fastmath: set[str] | bool = False) -> Callable[[Loop], Loop]:
    """Compile a function at its first call, and keep that for later processes where a folder can be written.

    numba knows a change of the loop's own file, not of this one: after editing this, delete the caches.
    Division by zero gives what it gives in NumPy: a check would keep loops from being vectorised.

    Args:
        fastmath: liberties with rounding, by LLVM's names.
    """

    def decorate(function: Loop) -> Loop:
        try:
            return njit(cache=True, fastmath=fastmath, error_model="numpy")(function)
        except RuntimeError:  # no place for a cache
            return njit(fastmath=fastmath, error_model="numpy")(function)

    return decorate
