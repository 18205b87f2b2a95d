"""Compute a `VectorNetwork` only where there are ships: the same result for a third of the work.

A batch holds scenes with few ships and with many. The layers of each ship compute one row for each ship that
is there, not for each place. Sums and maxima over the ships of a scene are one loop. Of a maximum the
gradient goes to the first ship that has it; torch shares it among equals.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ship_trl.fast.incremental import CopyCache, as_numpy, round_up
from ship_trl.fast.packed_kernels import pool, unpool
from ship_trl.learn.network import DuelingNetwork


class Ships(NamedTuple):
    """The ships of B scenes.

    Attributes:
        own: own ship's numbers [B, O].
        rows: input of the layers of each ship [R, O + M].
        first: row of each scene's first ship, int64 [B + 1].
    """

    own: Tensor
    rows: Tensor
    first: np.ndarray[Any, Any]


def pack(observation: Tensor, own: int, numbers: int, dtype: torch.dtype) -> Ships:
    """Pack observations [B, O + K M] with O = `own` and M = `numbers`; the last is 0 in empty places."""
    alone, places = observation[:, :own], observation[:, own:].unflatten(1, (-1, numbers))
    present = places[..., -1] != 0
    scene, place = present.nonzero(as_tuple=True)
    rows = torch.zeros(round_up(max(1, len(scene))), own + numbers, dtype=dtype)
    rows[: len(scene), :own], rows[: len(scene), own:] = alone[scene], places[scene, place]
    first = np.zeros(len(observation) + 1, np.int64)
    np.cumsum(present.sum(1).numpy(), out=first[1:])
    return Ships(alone, rows, first)


class PackedLayers(torch.autograd.Function):
    """The layers up to the last hidden one: `Ships` to float32 [B, H]; gradients of weights are float32.

    `layers` are weights and biases in the precision of the rows. The same in float32 follow, in turn.
    """

    @staticmethod
    def forward(
        ctx: Any, ships: Ships, per_ship: int, layers: list[tuple[Tensor, Tensor]], *_: Tensor
    ) -> Tensor:
        """Multiply, add and apply ReLU layer by layer; pool after the layers of each ship."""
        x, seen, out, which = ships.rows, [], [], None
        for n, (weight, bias) in enumerate(layers, 1):
            seen.append(x)
            x = torch.addmm(bias, x, weight.t()).relu_()
            out.append(x)
            if n == per_ship:
                pooled = torch.empty(len(ships.own), 2 * x.shape[1])
                which = np.empty((len(ships.own), x.shape[1]), np.int32)
                pool(as_numpy(x), ships.first, pooled.numpy(), which)
                x = torch.cat((ships.own, pooled), 1).to(x.dtype)
        ctx.save_for_backward(*seen, *out, *(weight for weight, _ in layers))
        ctx.ships, ctx.per_ship, ctx.which = ships, per_ship, which
        return x.float()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Compute the gradients of the weights that learn."""
        count = len(ctx.saved_tensors) // 3
        seen, out, weights = (ctx.saved_tensors[k * count : (k + 1) * count] for k in range(3))
        gradient, found = gradient.to(out[-1].dtype), []
        for n in range(count, 0, -1):
            if n == ctx.per_ship:
                rows = torch.zeros(out[n - 1].shape)
                pooled = gradient[:, ctx.ships.own.shape[1] :].float().contiguous()
                unpool(pooled.numpy(), ctx.ships.first, ctx.which, as_numpy(out[n - 1]), rows.numpy())
                gradient = rows.to(gradient.dtype)
            else:
                gradient = torch.ops.aten.threshold_backward(gradient, out[n - 1], 0)
            learns = ctx.needs_input_grad[1 + 2 * n]
            found.append(gradient.sum(0).float() if learns else None)
            found.append((gradient.t() @ seen[n - 1]).float() if learns else None)
            if not any(ctx.needs_input_grad[3 : 1 + 2 * n]):
                break
            gradient = gradient @ weights[n - 1]
        return (*[None] * (3 + 2 * count - len(found)), *reversed(found))


class Packed:
    """Backend for the CPU that computes the layers of each ship only where there is one.

    Args:
        dtype: precision of the layers; weights and their gradients stay float32.
    """

    name = "packed"

    def __init__(self, dtype: torch.dtype) -> None:
        self.dtype = dtype
        self._copies = CopyCache(dtype)

    def __deepcopy__(self, memo: dict[int, Any]) -> Packed:
        """Return this backend itself: a copied network shares its backend."""
        return self

    def features(self, network: DuelingNetwork, observation: Tensor) -> Tensor:
        """Compute all layers of `layer_names`: float32 [B, F] to float32 [B, H]."""
        weights = [weight for layer in network.layers for weight in (layer.weight, layer.bias)]
        layers, config = self._copies.layers(network, weights), network.config
        ships = pack(observation, config.own_numbers, config.ship_numbers, self.dtype)
        return PackedLayers.apply(ships, config.per_ship, layers, *weights)

    def features_from(self, network: DuelingNetwork, frozen_features: Tensor) -> Tensor:
        """Raise: numbers are quick to compute, so that no replay stores what frozen layers make of them."""
        raise NotImplementedError("features_from: networks from numbers have no features of frozen layers")
