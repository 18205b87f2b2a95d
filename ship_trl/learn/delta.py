"""The conv layers on what differs from a still picture: the same function for half the work.

Most of what the network sees never changes: the water, the disc, the circles, own ship. A window
of a layer that holds nothing else has the same activation in every frame, so it is computed once a
batch. Layers are kept as rows, first those of the still picture, then those of the windows that
some frame touches; an index tells which row stands where. A layer is then one matrix product over
gathered rows. This is exact whatever the still picture is; a wrong one only saves nothing.

`filters` learns from batches of such rows; `glance` reads a few frames, for which the rows of the
still picture would be most of the work, and takes those from memory.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ship_trl.learn import delta_kernels as kernels

# Kernel, stride and side of the output of conv1 to conv3.
GEOMETRY = ((8, 4, 20), (4, 2, 9), (3, 1, 7))
# Matrix products are prepared anew for each shape; rounded, there are few shapes.
ROUND_ROWS, ROUND_FEW_ROWS = 64, 8


class Rows(NamedTuple):
    """A batch of B frames, as the layers that are still to come need it.

    `values` [R, C] are activations, or windows of pixels; `indices` has an entry for each conv
    layer to come: int32 [T, K], the rows that each of its T windows holds, or None where `values`
    are its windows already. Rows are numbered as if those of the still picture came first, even
    where they are left out.
    """

    values: Tensor
    indices: tuple[Tensor | None, ...]


class Cutter:
    """Cuts frames into windows: uint8 [B, C, 84, 84] to the `Rows` of conv1.

    Args:
        still: the picture that most frames resemble, uint8 [C, 84, 84].
        dtype: of the windows, whose values are 0 to 1.
    """

    def __init__(self, still: Tensor, dtype: torch.dtype) -> None:
        self.dtype = dtype
        still = still.contiguous()
        self.still_words = still.view(torch.int32).numpy()
        self.worth = as_numpy((torch.arange(256) / 255.0).to(dtype))
        windows = still.unfold(1, 8, 4).unfold(2, 8, 4).permute(1, 2, 3, 4, 0).flatten(2).flatten(0, 1)
        self.still_windows = (windows / 255.0).to(dtype)

    def __call__(self, frames: Tensor, still: bool = True) -> Rows:
        """Find what differs from the still picture, and where it lies.

        Without `still`, windows of the still picture itself are left out.
        """
        batch = frames.shape[0]
        frames = frames.contiguous()
        touched = [np.empty((batch, side, side), np.bool_) for _, _, side in GEOMETRY]
        tables = [np.empty((batch, side * side), np.int32) for _, _, side in GEOMETRY]
        # The number of the first row that is kept.
        base = [0 if still else side * side for _, _, side in GEOMETRY]
        kernels.mark_pixels(frames.view(torch.int32).numpy(), self.still_words, touched[0])
        rows = [kernels.number(touched[0], tables[0])]
        for n in (1, 2):
            kernel, stride, _ = GEOMETRY[n]
            kernels.mark_windows(touched[n - 1], kernel, stride, touched[n])
            rows.append(kernels.number(touched[n], tables[n]))
        windows = torch.zeros(rounded(rows[0] - base[0]), self.still_windows.shape[1], dtype=self.dtype)
        if still:
            windows[: len(self.still_windows)] = self.still_windows
        pixels, side = frames.numpy(), GEOMETRY[0][2]
        kernels.cut_pixels(pixels, tables[0], side, self.worth, as_numpy(windows), base[0])
        indices: list[Tensor | None] = [None]
        for n in (1, 2):
            kernel, stride, side = GEOMETRY[n]
            index = np.zeros((rounded(rows[n] - base[n]), kernel * kernel), np.int32)
            below = GEOMETRY[n - 1][2]
            kernels.index_windows(tables[n - 1], below, tables[n], side, kernel, stride, index, base[n])
            indices.append(torch.from_numpy(index))
        return Rows(windows, (*indices, torch.from_numpy(tables[2])))


def rounded(rows: int) -> int:
    """Up to the next multiple of `ROUND_ROWS`; the rows added are zero and nobody refers to them."""
    step = ROUND_ROWS if rows > ROUND_ROWS else ROUND_FEW_ROWS
    return -(-rows // step) * step


def as_numpy(values: Tensor) -> np.ndarray[Any, Any]:
    """The same memory as an array; NumPy knows no bfloat16, so its bits as uint16."""
    return (values.view(torch.uint16) if values.dtype is torch.bfloat16 else values).numpy()


def gathered_layer(rows: Tensor, index: Tensor | None, weight: Tensor, bias: Tensor) -> tuple[Tensor, Tensor]:
    """The windows `rows[index]` and `relu(windows @ weight.T + bias)`: one conv layer.

    Shapes: rows [R, C], index int32 [T, K] (None: rows are windows already), weight [O, K C],
    bias [O]; returns [T, K C] and [T, O].
    """
    windows = (
        rows if index is None else rows.index_select(0, index.view(-1)).view(len(index), weight.shape[1])
    )
    return windows, torch.addmm(bias, windows, weight.t()).relu_()


class GatheredLayer(torch.autograd.Function):
    """`gathered_layer` with gradients; returns [T, O] alone."""

    @staticmethod
    def forward(ctx: Any, rows: Tensor, index: Tensor | None, weight: Tensor, bias: Tensor) -> Tensor:
        """Gather, multiply, cut off below zero."""
        windows, out = gathered_layer(rows, index, weight, bias)
        ctx.save_for_backward(windows, index, weight, out)
        ctx.rows = rows.shape
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of rows, weight and bias, each where it is needed."""
        windows, index, weight, out = ctx.saved_tensors
        gradient = torch.ops.aten.threshold_backward(gradient, out, 0)
        to_rows = to_weight = to_bias = None
        if ctx.needs_input_grad[0]:
            total = torch.zeros(ctx.rows, dtype=torch.float32)
            pieces = (gradient @ weight).view(*index.shape, -1)
            kernels.scatter_add(as_numpy(pieces), index.numpy(), total.numpy())
            to_rows = total.to(gradient.dtype)
        if ctx.needs_input_grad[2]:
            to_weight, to_bias = gradient.t() @ windows, gradient.sum(0)
        return to_rows, None, to_weight, to_bias
