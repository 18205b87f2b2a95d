"""Extract the windows of frames that differ from a background, for `incremental`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ship_trl.config.network import WORD, Geometry, linear_from, supports_incremental
from ship_trl.learn.fast import incremental_kernels as kernels

# Row counts are rounded up to these multiples: oneDNN prepares a matrix product for each new shape.
ROUND_ROWS, ROUND_FEW_ROWS = 64, 8


class Rows(NamedTuple):
    """A batch of B frames as input of the remaining layers.

    Attributes:
        values: activations, or windows of pixels, [R, C].
        indices: for each remaining conv layer, the rows in each of its T windows, int32 [T, K]; None if the
            rows are the windows. The background's rows come first.
    """

    values: Tensor
    indices: tuple[Tensor | None, ...]


class WindowExtractor:
    """Extracts the windows of conv1 that differ from a background: uint8 [B, C, 84, 84] to `Rows`.

    `background` is uint8 [C, 84, 84]. Values of windows are 0 to 1, in precision `dtype`.
    """

    def __init__(self, background: Tensor, dtype: torch.dtype, geometry: Geometry) -> None:
        if not supports_incremental(geometry):
            raise ValueError(
                f"geometry: needs two conv layers, the first with kernel and stride in multiples of {WORD}, "
                f"got {geometry}"
            )
        self.dtype = dtype
        # Layers whose windows are rows. After them each frame is one row, so the others are linear layers.
        self.layers = geometry[: linear_from(geometry)]
        self.linear = len(geometry) - len(self.layers)
        self.sides = [layer.side for layer in self.layers]
        _, kernel, stride, _ = geometry[0]
        self._mark_pixels = kernels.compile_mark_pixels(kernel // WORD, stride // WORD)
        self._copy_windows = kernels.compile_copy_windows(kernel, stride)
        background = background.contiguous()
        self.background_words = background.view(torch.int32).numpy()
        self.levels = as_numpy((torch.arange(256) / 255.0).to(dtype))
        windows = background.unfold(1, kernel, stride).unfold(2, kernel, stride)
        windows = windows.permute(1, 2, 3, 4, 0).flatten(2).flatten(0, 1)
        self.background_windows = (windows / 255.0).to(dtype)

    def __call__(self, frames: Tensor) -> Rows:
        """Extract the windows that differ, behind those of the background."""
        batch, sides = frames.shape[0], self.sides
        frames = frames.contiguous()
        touched = [np.empty((batch, side, side), np.bool_) for side in sides]
        tables = [np.empty((batch, side * side), np.int32) for side in sides]
        self._mark_pixels(frames.view(torch.int32).numpy(), self.background_words, touched[0])
        rows = [kernels.number_windows(touched[0], tables[0])]
        for n, (_, kernel, stride, _) in enumerate(self.layers[1:], 1):
            kernels.mark_windows(touched[n - 1], kernel, stride, touched[n])
            rows.append(kernels.number_windows(touched[n], tables[n]))
        windows = torch.zeros(round_up(rows[0]), self.background_windows.shape[1], dtype=self.dtype)
        windows[: len(self.background_windows)] = self.background_windows
        self._copy_windows(frames.numpy(), tables[0], sides[0], self.levels, as_numpy(windows))
        indices: list[Tensor | None] = [None]
        for n, (_, kernel, stride, below) in enumerate(self.layers[1:], 1):
            index = np.zeros((round_up(rows[n]), kernel * kernel), np.int32)
            kernels.index_windows(tables[n - 1], below, tables[n], sides[n], kernel, stride, index)
            indices.append(torch.from_numpy(index))
        return Rows(windows, (*indices, torch.from_numpy(tables[-1]), *[None] * (self.linear - 1)))


def round_up(rows: int) -> int:
    """Round a row count up to a multiple of `ROUND_ROWS`; no index refers to the added zero rows."""
    step = ROUND_ROWS if rows > ROUND_ROWS else ROUND_FEW_ROWS
    return -(-rows // step) * step


def as_numpy(values: Tensor) -> np.ndarray[Any, Any]:
    """View a tensor as an array; view bfloat16 as uint16, because NumPy lacks it."""
    return (values.view(torch.uint16) if values.dtype is torch.bfloat16 else values).numpy()
