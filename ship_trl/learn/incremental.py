"""The conv layers on what differs from a background: the same function for half the work.

Most of what the network sees never changes: the water, the disc, the circles, own ship. A window
of a layer that holds nothing else has the same activation in every frame, so it is computed once a
batch. Layers are kept as rows, first those of the background, then those of the windows that
some frame touches; an index tells which row stands where. A layer is then one matrix product over
gathered rows. This is exact whatever the background is; a wrong one only saves nothing.

`Incremental` learns from batches of such rows; `inference.CachedInference` reads a few frames, for which the
rows of the background would be most of the work, and takes those from memory.
"""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ship_trl.learn import incremental_kernels as kernels
from ship_trl.learn.changes import version
from ship_trl.learn.network import CONV_NAMES, DuelingNetwork

# Kernel, stride and side of the output of conv1 to conv3.
GEOMETRY = ((8, 4, 20), (4, 2, 9), (3, 1, 7))
# Matrix products are prepared anew for each shape; rounded, there are few shapes.
ROUND_ROWS, ROUND_FEW_ROWS = 64, 8


class Rows(NamedTuple):
    """A batch of B frames, as the layers that are still to come need it.

    `values` [R, C] are activations, or windows of pixels; `indices` has an entry for each conv
    layer to come: int32 [T, K], the rows that each of its T windows holds, or None where `values`
    are its windows already. Rows are numbered as if those of the background came first, even
    where they are left out.
    """

    values: Tensor
    indices: tuple[Tensor | None, ...]


class Cutter:
    """Cuts frames into windows: uint8 [B, C, 84, 84] to the `Rows` of conv1.

    Args:
        background: the picture that most frames resemble, uint8 [C, 84, 84].
        dtype: of the windows, whose values are 0 to 1.
    """

    def __init__(self, background: Tensor, dtype: torch.dtype) -> None:
        self.dtype = dtype
        background = background.contiguous()
        self.background_words = background.view(torch.int32).numpy()
        self.worth = as_numpy((torch.arange(256) / 255.0).to(dtype))
        windows = background.unfold(1, 8, 4).unfold(2, 8, 4).permute(1, 2, 3, 4, 0).flatten(2).flatten(0, 1)
        self.background_windows = (windows / 255.0).to(dtype)

    def __call__(self, frames: Tensor, background: bool = True) -> Rows:
        """Find what differs from the background, and where it lies.

        Without `background`, windows of the background itself are left out.
        """
        batch = frames.shape[0]
        frames = frames.contiguous()
        touched = [np.empty((batch, side, side), np.bool_) for _, _, side in GEOMETRY]
        tables = [np.empty((batch, side * side), np.int32) for _, _, side in GEOMETRY]
        # The number of the first row that is kept.
        base = [0 if background else side * side for _, _, side in GEOMETRY]
        kernels.mark_pixels(frames.view(torch.int32).numpy(), self.background_words, touched[0])
        rows = [kernels.number(touched[0], tables[0])]
        for n in (1, 2):
            kernel, stride, _ = GEOMETRY[n]
            kernels.mark_windows(touched[n - 1], kernel, stride, touched[n])
            rows.append(kernels.number(touched[n], tables[n]))
        windows = torch.zeros(rounded(rows[0] - base[0]), self.background_windows.shape[1], dtype=self.dtype)
        if background:
            windows[: len(self.background_windows)] = self.background_windows
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
    """View the same memory as an array; NumPy knows no bfloat16, so its bits as uint16."""
    return (values.view(torch.uint16) if values.dtype is torch.bfloat16 else values).numpy()


def as_matrix(weight: Tensor) -> Tensor:
    """View filters [O, C, H, W] as a matrix [O, H W C].

    Raises:
        RuntimeError: they do not lie channels last, so that only a copy could be given.
    """
    return weight.permute(0, 2, 3, 1).view(len(weight), -1)


def gathered_layer(rows: Tensor, index: Tensor | None, weight: Tensor, bias: Tensor) -> tuple[Tensor, Tensor]:
    """Compute one conv layer: the windows `rows[index]` and `relu(windows @ weight.T + bias)`.

    Shapes: rows [R, C], index int32 [T, K] (None: rows are windows already), weight [O, K C],
    bias [O]; returns [T, K C] and [T, O].
    """
    windows = (
        rows if index is None else rows.index_select(0, index.view(-1)).view(len(index), weight.shape[1])
    )
    return windows, torch.addmm(bias, windows, weight.t()).relu_()


class GatheredLayer(torch.autograd.Function):
    """A conv layer on gathered rows, in their precision; gradients of its weights are float32.

    Shapes: rows [R, C], index int32 [T, K] or None, weight float32 [O, C, H, W] channels last, bias
    float32 [O]; then both in the precision of the rows, as a matrix [O, K C] and [O]; returns [T, O].
    """

    @staticmethod
    def forward(
        ctx: Any,
        rows: Tensor,
        index: Tensor | None,
        weight: Tensor,
        _bias: Tensor,
        matrix: Tensor,
        bias: Tensor,
    ) -> Tensor:
        """Gather, multiply, cut off below zero."""
        windows, out = gathered_layer(rows, index, matrix, bias)
        ctx.save_for_backward(windows, index, matrix, out)
        ctx.rows, ctx.filters = rows.shape, weight.shape
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of rows, weight and bias, each where it is needed."""
        windows, index, matrix, out = ctx.saved_tensors
        gradient = torch.ops.aten.threshold_backward(gradient, out, 0)
        to_rows = to_weight = to_bias = None
        if ctx.needs_input_grad[0]:
            total = torch.zeros(ctx.rows, dtype=torch.float32)
            pieces = (gradient @ matrix).view(*index.shape, -1)
            kernels.scatter_add(as_numpy(pieces), index.numpy(), total.numpy())
            to_rows = total.to(gradient.dtype)
        if ctx.needs_input_grad[2]:
            filters, channels, height, width = ctx.filters
            flat = (gradient.t() @ windows).float()
            to_weight = flat.view(filters, height, width, channels).permute(0, 3, 1, 2)
            to_bias = gradient.sum(0).float()
        return to_rows, None, to_weight, to_bias, None, None


class Copies:
    """Conv layers as matrices [O, H W C] and biases [O] in the precision that computes.

    In float32 they are the weights' own memory; else copies, written anew by `refresh`.
    """

    def __init__(self, weights: list[Tensor], dtype: torch.dtype) -> None:
        self.places = [weight.data_ptr() for weight in weights]
        self._own = [as_matrix(w.detach()) if w.dim() == 4 else w.detach() for w in weights]
        self._copies = [own.to(dtype) for own in self._own]
        self._versions: list[tuple[int, ...]] = [(), ()]
        self._prepared = False
        self.layers = list(zip(self._copies[::2], self._copies[1::2], strict=True))

    def refresh(self, weights: list[Tensor], frozen: int, ahead: bool = False) -> None:
        """Copy what may have changed since the last time.

        Args:
            weights: those from which this was made.
            frozen: how many layers never learn.
            ahead: nothing will change before the next call, which then copies nothing.
        """
        if self._copies[0].dtype is torch.float32:
            return
        learning = weights[2 * frozen :]
        now = [version(weights[: 2 * frozen], learning=False), version(learning)]
        if learning and not learning[0].requires_grad and (ahead or not self._prepared):
            # A target network changes by writing to its data, which no version tells.
            self._versions[1] = ()
        for part, before, after in zip(
            (slice(2 * frozen), slice(2 * frozen, None)), self._versions, now, strict=True
        ):
            if before != after and self._own[part]:
                torch._foreach_copy_(self._copies[part], self._own[part])
        self._versions, self._prepared = now, ahead


class Incremental:
    """Computes the conv layers on the windows that differ from the background (see above), on a CPU.

    What it made of the frames that it saw last is remembered up to the first layer that learns: the
    online network and the target network read the same next observations, one after the other.

    Args:
        background: the picture that most frames resemble, uint8 [C, 84, 84].
        dtype: of the conv layers. Weights and their gradients stay float32.
    """

    def __init__(self, background: Tensor, dtype: torch.dtype) -> None:
        self.dtype = dtype
        self._cut = Cutter(background, dtype)
        self._seen: tuple[Tensor, tuple[int, ...], Rows] | None = None
        self._copies: WeakKeyDictionary[DuelingNetwork, Copies] = WeakKeyDictionary()

    def __deepcopy__(self, memo: dict[int, Any]) -> Incremental:
        """Stay one: a copied network shares it."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is remembered."""
        return self.__dict__ | {"_seen": None, "_copies": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Remember nothing."""
        self.__dict__ |= state | {"_copies": WeakKeyDictionary()}

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to float32 [B, 200]."""
        return self._rest(network, self._through_frozen(network, pixels))

    def features_from(self, network: DuelingNetwork, kept: Tensor) -> Tensor:
        """Compute those after the frozen ones: [B, F] to float32 [B, 200]."""
        if network.frozen == len(CONV_NAMES):
            return kept.float()
        return self._rest(network, Rows(kept.to(self.dtype), (None,) * (len(CONV_NAMES) - network.frozen)))

    def prepare(self, network: DuelingNetwork) -> None:
        """Copy the weights now, while they are in the processor's cache: half a millisecond an update."""
        if self.dtype is not torch.float32 and network.frozen < len(CONV_NAMES):
            self._copied(network, network.conv_weights(), ahead=True)

    def _through_frozen(self, network: DuelingNetwork, pixels: Tensor) -> Rows:
        """Cut frames into windows, and take them through the frozen layers."""
        frozen = [getattr(network, name).weight for name in CONV_NAMES[: network.frozen]]
        # Who and which version: weights that are replaced or changed in place are others.
        state = (*version([pixels, *frozen], learning=False), *(weight.data_ptr() for weight in frozen))
        if self._seen is None or self._seen[0] is not pixels or self._seen[1] != state:
            with torch.no_grad():
                rows = self._advance(network, self._cut(pixels), network.frozen)
            self._seen = (pixels, state, rows)
        return self._seen[2]

    def _rest(self, network: DuelingNetwork, rows: Rows) -> Tensor:
        """Take rows through all layers that are left."""
        # The fully connected layers compute in float32: there the differences between actions are small.
        return self._advance(network, rows, len(rows.indices)).values.float()

    def _advance(self, network: DuelingNetwork, rows: Rows, layers: int) -> Rows:
        """Take rows through the next `layers` conv layers, with gradients where torch records them."""
        if layers == 0:
            return rows
        values, indices = rows
        weights = network.conv_weights()
        copies = self._copied(network, weights)
        first = len(CONV_NAMES) - len(indices)
        for n in range(first, first + layers):
            index, (matrix, bias) = indices[n - first], copies.layers[n]
            if torch.is_grad_enabled():
                values = GatheredLayer.apply(values, index, weights[2 * n], weights[2 * n + 1], matrix, bias)
            else:
                _, values = gathered_layer(values, index, matrix, bias)
        return Rows(values, indices[layers:])

    def _copied(self, network: DuelingNetwork, weights: list[Tensor], ahead: bool = False) -> Copies:
        """Give the network's conv layers in the precision that computes, as they are now."""
        copies = self._copies.get(network)
        if copies is None or copies.places != [weight.data_ptr() for weight in weights]:
            copies = self._copies[network] = Copies(weights, self.dtype)
        copies.refresh(weights, network.frozen, ahead)
        return copies
