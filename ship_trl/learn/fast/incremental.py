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

from typing import Any
from weakref import WeakKeyDictionary

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ship_trl.config.network import Geometry
from ship_trl.learn.fast import incremental_kernels as kernels
from ship_trl.learn.fast.changes import version
from ship_trl.learn.fast.cutter import Cutter, Rows, as_numpy
from ship_trl.learn.network import DuelingNetwork


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
            to_rows = gradient @ matrix
            if index is not None:
                total = torch.zeros(ctx.rows, dtype=torch.float32)
                kernels.scatter_add(as_numpy(to_rows.view(*index.shape, -1)), index.numpy(), total.numpy())
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
        self.layers = list(zip(self._copies[::2], self._copies[1::2], strict=True))

    def refresh(self, weights: list[Tensor], frozen: int) -> None:
        """Copy what may have changed since the last time.

        Args:
            weights: those from which this was made.
            frozen: how many layers never learn.
        """
        if self._copies[0].dtype is torch.float32:
            return
        learning = weights[2 * frozen :]
        now = [version(weights[: 2 * frozen], learning=False), version(learning)]
        if learning and not learning[0].requires_grad:
            # A target network changes by writing to its data, which no version tells.
            self._versions[1] = ()
        for part, before, after in zip(
            (slice(2 * frozen), slice(2 * frozen, None)), self._versions, now, strict=True
        ):
            if before != after and self._own[part]:
                torch._foreach_copy_(self._copies[part], self._own[part])
        self._versions = now


class Incremental:
    """Computes the conv layers on the windows that differ from the background (see above), on a CPU.

    What it made of the frames that it saw last is remembered up to the first layer that learns: the
    online network and the target network read the same next observations, one after the other.

    Args:
        background: the picture that most frames resemble, uint8 [C, 84, 84].
        dtype: of the conv layers. Weights and their gradients stay float32.
        geometry: of the conv layers of every network that it will compute, as `supports_incremental` says.
    """

    def __init__(self, background: Tensor, dtype: torch.dtype, geometry: Geometry) -> None:
        self.dtype, self.geometry = dtype, geometry
        self._cut = Cutter(background, dtype, geometry)
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
        """Compute all conv layers: uint8 [B, C, 84, 84] to float32 [B, F].

        Raises:
            ValueError: the network is of another geometry.
        """
        if network.geometry != self.geometry:
            raise ValueError("network: its conv layers are others than those that this was made for")
        return self._rest(network, self._through_frozen(network, pixels))

    def features_from(self, network: DuelingNetwork, kept: Tensor) -> Tensor:
        """Compute those after the frozen ones: [B, K] to float32 [B, F]."""
        left = len(self.geometry) - network.frozen
        if left == 0:
            return kept.float()
        return self._rest(network, Rows(kept.to(self.dtype), (None,) * left))

    def _through_frozen(self, network: DuelingNetwork, pixels: Tensor) -> Rows:
        """Cut frames into windows, and take them through the frozen layers."""
        frozen = [conv.weight for conv in network.convs[: network.frozen]]
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
        first = len(self.geometry) - len(indices)
        for n in range(first, first + layers):
            index, (matrix, bias) = indices[n - first], copies.layers[n]
            if torch.is_grad_enabled():
                values = GatheredLayer.apply(values, index, weights[2 * n], weights[2 * n + 1], matrix, bias)
            else:
                _, values = gathered_layer(values, index, matrix, bias)
        return Rows(values, indices[layers:])

    def _copied(self, network: DuelingNetwork, weights: list[Tensor]) -> Copies:
        """Give the network's conv layers in the precision that computes, as they are now."""
        copies = self._copies.get(network)
        if copies is None or copies.places != [weight.data_ptr() for weight in weights]:
            copies = self._copies[network] = Copies(weights, self.dtype)
        copies.refresh(weights, network.frozen)
        return copies
