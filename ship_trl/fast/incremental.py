"""Compute conv layers only where a frame differs from a background: the same result for half the work.

Most pixels never change: water, disc, circles, own ship. A window that shows only these has the same
activation in every frame, so it is computed once per batch. A layer's activations are stored as rows: first
one for each window of the background, then one for each window of a frame that differs. An index maps windows
to rows, and a layer is one matrix product over gathered rows. The result is exact for any background, but
only a similar one saves work.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.optim.optimizer import register_optimizer_step_post_hook

from ship_trl.config.network import WORD, Geometry, linear_from, supports_incremental
from ship_trl.fast import incremental_kernels as kernels
from ship_trl.learn.network import DuelingNetwork

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


def mark_changed(optimiser: torch.optim.Optimizer, *_: Any) -> None:
    """Mark the weights that an optimiser has changed: fused ones leave the version of a tensor as it is."""
    weights = (weight for group in optimiser.param_groups for weight in group["params"])
    torch.autograd.graph.increment_version([weight for weight in weights if weight.grad is not None])


register_optimizer_step_post_hook(mark_changed)


def versions(weights: Iterable[Tensor]) -> tuple[int, ...]:
    """Return numbers that change when the weights change; inference tensors count as unchanged."""
    return tuple(-1 if weight.is_inference() else weight._version for weight in weights)  # noqa: SLF001


def as_matrix(weight: Tensor) -> Tensor:
    """View channels-last filters [O, C, H, W] as a matrix [O, H W C]."""
    return weight.permute(0, 2, 3, 1).view(len(weight), -1)


def gather(rows: Tensor, index: Tensor | None) -> Tensor:
    """Return the windows [T, K C] at int32 [T, K] of rows [R, C]; without an index the rows."""
    if index is None:
        return rows
    return rows.index_select(0, index.view(-1)).view(len(index), index.shape[1] * rows.shape[1])


class GatheredLayers(torch.autograd.Function):
    """Conv layers on gathered rows, in the rows' precision; gradients of weights are float32.

    Takes rows [R, C], and for each layer: an index, int32 [T, K] or None; a matrix [O, K C] and a bias [O] in
    the precision of the rows; and at the end, in turn, the filters float32 [O, C, H, W], channels last, and
    biases that these are copies of. Returns [T, O] of the last layer.
    """

    @staticmethod
    def forward(
        ctx: Any,
        rows: Tensor,
        indices: Sequence[Tensor | None],
        layers: Sequence[tuple[Tensor, Tensor]],
        *weights: Tensor,
    ) -> Tensor:
        """Gather the windows, multiply, apply ReLU, layer by layer."""
        seen, out = [], []
        for index, (matrix, bias) in zip(indices, layers, strict=True):
            seen.append(gather(rows, index))
            out.append(rows := torch.addmm(bias, seen[-1], matrix.t()).relu_())
        ctx.save_for_backward(*seen, *out, *(matrix for matrix, _ in layers))
        ctx.indices, ctx.filters = indices, [filters.shape for filters in weights[::2]]
        return rows

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Compute the gradients of the weights that learn."""
        count = len(ctx.indices)
        seen, out, matrices = (ctx.saved_tensors[k * count : (k + 1) * count] for k in range(3))
        gradient, found = torch.ops.aten.threshold_backward(gradient, out[-1], 0), []
        for n in reversed(range(count)):
            learns = ctx.needs_input_grad[3 + 2 * n]
            found.append(gradient.sum(0).float() if learns else None)
            found.append(as_filters(gradient.t() @ seen[n], ctx.filters[n]) if learns else None)
            if not any(ctx.needs_input_grad[3 : 3 + 2 * n]):
                break
            gradient = gradient @ matrices[n]
            if ctx.indices[n] is None:
                gradient = torch.ops.aten.threshold_backward(gradient, out[n - 1], 0)
            else:
                total = torch.zeros(out[n - 1].shape)
                kernels.scatter_add(as_numpy(gradient), ctx.indices[n].numpy(), total.numpy())
                gradient = torch.ops.aten.threshold_backward(total.to(gradient.dtype), out[n - 1], 0)
        return (*[None] * (3 + 2 * count - len(found)), *reversed(found))


def as_filters(matrix: Tensor, shape: torch.Size) -> Tensor:
    """View a matrix [O, H W C] as float32 channels-last filters [O, C, H, W]."""
    filters, channels, height, width = shape
    return matrix.float().view(filters, height, width, channels).permute(0, 3, 1, 2)


class WeightCopies:
    """Conv weights as matrices [O, H W C] and biases [O], in the precision of the backend.

    In float32 these are views of the weights. Otherwise they are copies, and `refresh` updates them.
    """

    def __init__(self, weights: list[Tensor], dtype: torch.dtype) -> None:
        self.pointers = [weight.data_ptr() for weight in weights]
        self._own = [as_matrix(w.detach()) if w.dim() == 4 else w.detach() for w in weights]
        self._copies = [own.to(dtype) for own in self._own]
        self._versions = versions(weights)
        self.layers = list(zip(self._copies[::2], self._copies[1::2], strict=True))

    def refresh(self, weights: list[Tensor]) -> None:
        """Update the copies of weights that have changed."""
        now = versions(weights)
        if now != self._versions and self._copies[0].dtype is not torch.float32:
            changed = [k for k, pair in enumerate(zip(self._versions, now, strict=True)) if len({*pair}) > 1]
            torch._foreach_copy_([self._copies[k] for k in changed], [self._own[k] for k in changed])
        self._versions = now


class CopyCache:
    """The weight copies of networks that share a backend, in one precision."""

    def __init__(self, dtype: torch.dtype) -> None:
        self._dtype = dtype
        self._copies: WeakKeyDictionary[DuelingNetwork, WeightCopies] = WeakKeyDictionary()

    def __reduce__(self) -> tuple[type[CopyCache], tuple[torch.dtype]]:
        """Pickle it without copies: another process makes its own."""
        return CopyCache, (self._dtype,)

    def layers(self, network: DuelingNetwork, weights: list[Tensor]) -> list[tuple[Tensor, Tensor]]:
        """Return the current copies of a network's weights and biases, given in turn."""
        copies = self._copies.get(network)
        if copies is None or copies.pointers != [weight.data_ptr() for weight in weights]:
            copies = self._copies[network] = WeightCopies(weights, self._dtype)
        copies.refresh(weights)
        return copies.layers


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
        self.background, self.dtype, self.geometry = background, dtype, geometry
        self._extract = WindowExtractor(background, dtype, geometry)
        self._cached: tuple[Tensor, tuple[int, ...], Rows] | None = None
        self._copies = CopyCache(dtype)

    def __reduce__(self) -> tuple[type[Incremental], tuple[Tensor, torch.dtype, Geometry]]:
        """Pickle it without its cache: another process makes its own."""
        return Incremental, (self.background, self.dtype, self.geometry)

    def __deepcopy__(self, memo: dict[int, Any]) -> Incremental:
        """Return this backend itself: a copied network shares its backend."""
        return self

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to float32 [B, F].

        Raises:
            ValueError: the network has another geometry.
        """
        if network.geometry != self.geometry:
            raise ValueError("network: its conv layers differ from those of this backend")
        return self._compute_remaining(network, self._compute_frozen(network, pixels))

    def features_from(self, network: DuelingNetwork, frozen_features: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones, which get no gradient: [B, K] to float32 [B, F]."""
        left = len(self.geometry) - network.frozen
        if left == 0:
            return frozen_features.float()
        return self._compute_remaining(network, Rows(frozen_features.to(self.dtype), (None,) * left))

    def _compute_frozen(self, network: DuelingNetwork, pixels: Tensor) -> Rows:
        """Extract windows and compute the frozen layers, or return the cached result."""
        frozen = [conv.weight for conv in network.layers[: network.frozen]]
        # Replaced or modified weights make the cache stale.
        token = (*versions([pixels, *frozen]), *(weight.data_ptr() for weight in frozen))
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
        weights = [weight for conv in network.layers for weight in (conv.weight, conv.bias)]
        first = len(self.geometry) - len(indices)
        copies = self._copies.layers(network, weights)[first : first + layers]
        now, rest = indices[:layers], indices[layers:]
        if torch.is_grad_enabled():
            learning = weights[2 * first : 2 * (first + layers)]
            return Rows(GatheredLayers.apply(values, now, copies, *learning), rest)
        for index, (matrix, bias) in zip(now, copies, strict=True):
            values = torch.addmm(bias, gather(values, index), matrix.t()).relu_()
        return Rows(values, rest)
