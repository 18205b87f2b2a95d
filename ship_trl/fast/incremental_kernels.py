"""Compiled loops of `incremental`: find windows that differ, and index their rows."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ship_trl.fast.jit import Loop, compiled

Array = np.ndarray[Any, Any]


@compiled()
def number_windows(touched: Array, table: Array) -> int:
    """Write the row number of each window into `table`, int32 [B, S * S], and return the number of rows.

    Untouched windows share the background's rows, which come first. Windows in `touched`, bool [B, S, S], get
    new rows.
    """
    batch, side = touched.shape[0], touched.shape[1]
    count = side * side
    for b in range(batch):
        for y in range(side):
            for x in range(side):
                place = y * side + x
                table[b, place] = place
                if touched[b, y, x]:
                    table[b, place] = count
                    count += 1
    return count


@compiled()
def mark_blocks(words: Array, background: Array, blocks: Array) -> None:
    """Write into `blocks` which 4 x 4 pixel blocks of a frame differ from the background; 0 means equal.

    Shapes: blocks int32 [H / 4, H / 4]; words and background int32 [C, H, H / 4], four pixels each.
    """
    channels, width = words.shape[0], words.shape[2]
    blocks[:] = 0
    for c in range(channels):
        for y in range(width):
            for row in range(4 * y, 4 * y + 4):
                for x in range(width):
                    blocks[y, x] |= words[c, row, x] ^ background[c, row, x]


@cache
def compile_mark_pixels(kernel: int, stride: int) -> Loop:
    """Compile `mark_pixels` for windows of `kernel` words that are `stride` words apart.

    Loops of constant length are twice as fast.
    """

    @compiled()
    def mark_pixels(words: Array, background: Array, touched: Array) -> None:
        """Write into `touched` which windows of conv1 have a pixel that differs from the background.

        Shapes: touched bool [B, S, S]; words int32 [B, C, H, H / 4], four pixels each; background without B.
        """
        batch, side, width = touched.shape[0], touched.shape[1], words.shape[3]
        blocks = np.empty((width, width), np.int32)
        for b in range(batch):
            mark_blocks(words[b], background, blocks)
            for y in range(side):
                for x in range(side):
                    found = np.int32(0)
                    for i in range(kernel):
                        for j in range(kernel):
                            found |= blocks[y * stride + i, x * stride + j]
                    touched[b, y, x] = found != 0

    return mark_pixels


@compiled()
def mark_windows(below: Array, kernel: int, stride: int, touched: Array) -> None:
    """Write into `touched`, bool [B, T, T], which windows include a touched position of `below` [B, S, S]."""
    batch, side = touched.shape[0], touched.shape[1]
    for b in range(batch):
        for y in range(side):
            for x in range(side):
                found = False
                for i in range(kernel):
                    for j in range(kernel):
                        found |= below[b, y * stride + i, x * stride + j]
                touched[b, y, x] = found


@cache
def compile_copy_windows(kernel: int, stride: int) -> Loop:
    """Compile `copy_windows` for windows of `kernel` pixels that are `stride` apart."""

    @compiled()
    def copy_windows(pixels: Array, table: Array, side: int, values: Array, rows: Array) -> None:
        """Copy the touched windows of conv1 into `rows`.

        Shapes: pixels uint8 [B, C, H, H]; table [B, S * S]; values [256], one for each pixel level; rows
        [R, kernel * kernel * C], in the order row, column, channel.
        """
        batch, channels = pixels.shape[:2]
        for b in range(batch):
            for y in range(side):
                for x in range(side):
                    row = table[b, y * side + x]
                    if row < side * side:
                        continue
                    for i in range(kernel):
                        window = rows[row, kernel * i * channels : kernel * (i + 1) * channels]
                        for c in range(channels):
                            line = pixels[b, c, stride * y + i, stride * x : stride * x + kernel]
                            for j in range(kernel):
                                window[j * channels + c] = values[line[j]]

    return copy_windows


@compiled()
def index_windows(
    below: Array,
    side_below: int,
    table: Array,
    side: int,
    kernel: int,
    stride: int,
    index: Array,
) -> None:
    """Write into `index`, for each row of a layer, the row numbers of the layer below that its window covers.

    Shapes: below [B, S * S] and table [B, T * T], row numbers in the layer below and in this one; index
    int32 [R, K * K].
    """
    # Frame -1 is the background. Its row numbers are the positions of its windows.
    for b in range(-1, table.shape[0]):
        for y in range(side):
            for x in range(side):
                row = y * side + x if b < 0 else table[b, y * side + x]
                if b < 0 or row >= side * side:
                    for i in range(kernel):
                        for j in range(kernel):
                            place = (y * stride + i) * side_below + x * stride + j
                            index[row, i * kernel + j] = place if b < 0 else below[b, place]


@compiled()
def widen(values: Array, row: Array, bits: Array) -> None:
    """Write `values` [W], float32 or bfloat16 viewed as uint16, into `row`, float32 [W] that `bits` views."""
    if values.itemsize == 2:
        for c in range(values.shape[0]):
            bits[c] = np.uint32(values[c]) << np.uint32(16)
    else:
        for c in range(values.shape[0]):
            row[c] = np.float32(values[c])


@compiled()
def scatter_add(gradient: Array, index: Array, total: Array) -> None:
    """Add each piece of `gradient` [R, K C] to row `index` [R, K] of `total` float32 [T, C].

    The gradient is float32, or bfloat16 viewed as uint16.
    """
    pieces, width = index.shape[1], total.shape[1]
    bits = np.empty(pieces * width, np.uint32)
    values = bits.view(np.float32)
    for r in range(index.shape[0]):
        # All pieces at once: short loops would spend most of their time before the first number.
        widen(gradient[r], values, bits)
        for k in range(pieces):
            row, piece = total[index[r, k]], values[k * width : (k + 1) * width]
            for c in range(width):
                row[c] += piece[c]
