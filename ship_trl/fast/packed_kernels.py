"""Compiled loops of `packed`: sums and maxima over the ships of a scene, and their gradient."""

from __future__ import annotations

import numpy as np

from ship_trl.fast.incremental_kernels import widen
from ship_trl.fast.jit import NO_NAN, compiled
from ship_trl.fast.step import ZERO, Array


@compiled(NO_NAN)
def pool(values: Array, first: Array, pooled: Array, which: Array) -> None:
    """Write sums and maxima of `values` [R, W] over the rows of each scene into `pooled`, float32 [B, 2 W].

    Rows `first[b]` to `first[b + 1]` are of scene b. No value is negative, so that without rows all is zero.
    Write the row of each maximum into `which`, int32 [B, W]; -1 where it is zero. Loops over the width are
    many, and write into memory of their own, because only such loops are vectorised.
    """
    width = values.shape[1]
    bits, winner = np.empty(width, np.uint32), np.empty(width, np.int32)
    total, most, row = np.empty(width, np.float32), np.empty(width, np.float32), bits.view(np.float32)
    for b in range(pooled.shape[0]):
        total[:], most[:], winner[:] = ZERO, ZERO, -1
        for r in range(first[b], first[b + 1]):
            widen(values[r], row, bits)
            here = np.int32(r)
            for c in range(width):
                total[c] += row[c]
            for c in range(width):
                winner[c] = here if row[c] > most[c] else winner[c]
            for c in range(width):
                most[c] = max(most[c], row[c])
        pooled[b, :width], pooled[b, width:], which[b] = total, most, winner


@compiled(NO_NAN)
def unpool(gradient: Array, first: Array, which: Array, values: Array, rows: Array) -> None:
    """Write the gradient of `values` before their ReLU into `rows`, float32 [R, W]; the others as `pool`."""
    width = values.shape[1]
    bits = np.empty(width, np.uint32)
    value = bits.view(np.float32)
    for b in range(gradient.shape[0]):
        total, most, winner = gradient[b, :width], gradient[b, width:], which[b]
        for r in range(first[b], first[b + 1]):
            here, row = np.int32(r), rows[r]
            widen(values[r], value, bits)
            for c in range(width):
                into = total[c] + (most[c] if winner[c] == here else ZERO)
                row[c] = into if value[c] > ZERO else ZERO
