"""Compute conv layers only where a frame differs from a background: the same result for half the work.

Most pixels never change: water, disc, circles, own ship. A window that shows only these has the same
activation in every frame, so it is computed once per batch. A layer's activations are stored as rows: first
one for each window of the background, then one for each window of a frame that differs. An index maps windows
to rows, and a layer is one matrix product over gathered rows. The result is exact for any background, but
only a similar one saves work.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ship_trl.config.network import Geometry
from ship_trl.learn.fast import incremental_kernels as kernels
from ship_trl.learn.fast.weights_version import weights_version
from ship_trl.learn.fast.windows import Rows, WindowExtractor, as_numpy
from ship_trl.learn.network import DuelingNetwork


def as_matrix(weight: Tensor) -> Tensor:
    """View channels-last filters [O, C, H, W] as a matrix [O, H W C]."""
    return weight.permute(0, 2, 3, 1).view(len(weight), -1)


def gathered_layer(rows: Tensor, index: Tensor | None, weight: Tensor, bias: Tensor) -> tuple[Tensor, Tensor]:
    """Compute one conv layer: return the windows `rows[index]` and `relu(windows @ weight.T + bias)`.

    Shapes: rows [R, C], index int32 [T, K] (None: rows are windows already), weight [O, K C],
    bias [O]; returns [T, K C] and [T, O].
    """
    windows = rows
    if index is not None:
        windows = rows.index_select(0, index.view(-1)).view(len(index), weight.shape[1])
    return windows, torch.addmm(bias, windows, weight.t()).relu_()


class GatheredLayer(torch.autograd.Function):
    """A conv layer on gathered rows, in the rows' precision; gradients of weights are float32.

    Shapes: rows [R, C]; index int32 [T, K] or None; weight float32 [O, C, H, W] channels last and its bias
    float32 [O]; the same weights in the rows' precision, matrix [O, K C] and bias [O]. Returns [T, O].
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
        """Gather the windows, multiply, apply ReLU."""
        windows, out = gathered_layer(rows, index, matrix, bias)
        ctx.save_for_backward(windows, index, matrix, out)
        ctx.rows, ctx.filters = rows.shape, weight.shape
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Compute the gradients of rows, weight and bias that are needed."""
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


class WeightCopies:
    """Conv weights as matrices [O, H W C] and biases [O], in the precision of the backend.

    In float32 these are views of the weights. Otherwise they are copies, and `refresh` updates them.
    """

    def __init__(self, weights: list[Tensor], dtype: torch.dtype) -> None:
        self.pointers = [weight.data_ptr() for weight in weights]
        self._own = [as_matrix(w.detach()) if w.dim() == 4 else w.detach() for w in weights]
        self._copies = [own.to(dtype) for own in self._own]
        self._versions: list[tuple[int, ...]] = [(), ()]
        self.layers = list(zip(self._copies[::2], self._copies[1::2], strict=True))

    def refresh(self, weights: list[Tensor], frozen: int) -> None:
        """Update the copies of weights that may have changed; the first `frozen` layers never learn."""
        if self._copies[0].dtype is torch.float32:
            return
        learning = weights[2 * frozen :]
        now = [weights_version(weights[: 2 * frozen], learning=False), weights_version(learning)]
        if learning and not learning[0].requires_grad:
            # A target network is updated through `data`, which changes no version.
            self._versions[1] = ()
        parts = slice(2 * frozen), slice(2 * frozen, None)
        for part, before, after in zip(parts, self._versions, now, strict=True):
            if before != after and self._own[part]:
                torch._foreach_copy_(self._copies[part], self._own[part])
        self._versions = now


class Incremental:
    """Backend for the CPU that computes conv layers only where frames differ from the background.

    It caches the frozen layers' activations of the last batch, because the online and the target network read
    the same next observations, one after the other.

    Args:
        background: frame that most frames resemble, uint8 [C, 84, 84].
        dtype: precision of the conv layers; weights and their gradients stay float32.
        geometry: conv layers of all networks that use it; `supports_incremental` must be true for them.
    """

    name = "incremental"

    def __init__(self, background: Tensor, dtype: torch.dtype, geometry: Geometry) -> None:
        self.dtype, self.geometry = dtype, geometry
        self._extract = WindowExtractor(background, dtype, geometry)
        self._cached: tuple[Tensor, tuple[int, ...], Rows] | None = None
        self._copies: WeakKeyDictionary[DuelingNetwork, WeightCopies] = WeakKeyDictionary()

    def __deepcopy__(self, memo: dict[int, Any]) -> Incremental:
        """Return this backend itself: a copied network shares its backend."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle, without the caches."""
        return self.__dict__ | {"_cached": None, "_copies": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore with empty caches."""
        self.__dict__ |= state | {"_copies": WeakKeyDictionary()}

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to float32 [B, F].

        Raises:
            ValueError: the network has another geometry.
        """
        if network.geometry != self.geometry:
            raise ValueError("network: its conv layers differ from those of this backend")
        return self._compute_remaining(network, self._compute_frozen(network, pixels))

    def features_from(self, network: DuelingNetwork, frozen_features: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones: [B, K] to float32 [B, F]."""
        left = len(self.geometry) - network.frozen
        if left == 0:
            return frozen_features.float()
        return self._compute_remaining(network, Rows(frozen_features.to(self.dtype), (None,) * left))

    def _compute_frozen(self, network: DuelingNetwork, pixels: Tensor) -> Rows:
        """Extract windows and compute the frozen layers, or return the cached result."""
        frozen = [conv.weight for conv in network.layers[: network.frozen]]
        # Replaced or modified weights make the cache stale.
        token = (
            *weights_version([pixels, *frozen], learning=False),
            *(weight.data_ptr() for weight in frozen),
        )
        if self._cached is None or self._cached[0] is not pixels or self._cached[1] != token:
            with torch.no_grad():
                rows = self._compute_layers(network, self._extract(pixels), network.frozen)
            self._cached = (pixels, token, rows)
        return self._cached[2]

    def _compute_remaining(self, network: DuelingNetwork, rows: Rows) -> Tensor:
        """Compute all remaining layers."""
        # The fully connected layers compute in float32, because Q-values of actions differ only slightly.
        return self._compute_layers(network, rows, len(rows.indices)).values.float()

    def _compute_layers(self, network: DuelingNetwork, rows: Rows, layers: int) -> Rows:
        """Compute the next `layers` conv layers, with gradients where torch records them."""
        if layers == 0:
            return rows
        values, indices = rows
        weights = network.conv_weights()
        copies = self._weight_copies(network, weights)
        first = len(self.geometry) - len(indices)
        for n in range(first, first + layers):
            index, (matrix, bias) = indices[n - first], copies.layers[n]
            if torch.is_grad_enabled():
                values = GatheredLayer.apply(values, index, weights[2 * n], weights[2 * n + 1], matrix, bias)
            else:
                _, values = gathered_layer(values, index, matrix, bias)
        return Rows(values, indices[layers:])

    def _weight_copies(self, network: DuelingNetwork, weights: list[Tensor]) -> WeightCopies:
        """Return the network's current conv weights in the precision of this backend."""
        copies = self._copies.get(network)
        if copies is None or copies.pointers != [weight.data_ptr() for weight in weights]:
            copies = self._copies[network] = WeightCopies(weights, self.dtype)
        copies.refresh(weights, network.frozen)
        return copies
