"""Q-values of K networks at once, whose parameters are stacked: one operation serves them all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor
from torch.func import functional_call, vmap

from ship_trl.config.network import ConvLayer
from ship_trl.learn.network import DuelingNetwork

Parameters = Mapping[str, Tensor]
# Maps stacked parameters and inputs [K, B, ...] to Q-values, float32 [K, B, A].
StackedQ = Callable[[Parameters, Tensor], Tensor]


class Windows(torch.autograd.Function):
    """All windows of maps: [N, H, W, C] to [N * side * side, kernel * kernel * C].

    A conv layer is then one matrix product for all networks. As a grouped convolution, to which torch turns
    stacked filters, its gradient is slow.
    """

    @staticmethod
    def forward(ctx: Any, maps: Tensor, layer: ConvLayer) -> Tensor:
        """Copy the windows."""
        ctx.layer, ctx.shape, ctx.dtype = layer, maps.shape, maps.dtype
        windows = maps.unfold(1, layer.kernel, layer.stride).unfold(2, layer.kernel, layer.stride)
        return windows.permute(0, 1, 2, 4, 5, 3).reshape(-1, layer.kernel**2 * maps.shape[-1])

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        """Sum up the gradients of each place of the maps, in float32."""
        (gradient,), layer, (count, _, _, channels) = gradients, ctx.layer, ctx.shape
        side, kernel, stride = layer.side, layer.kernel, layer.stride
        windows = gradient.view(count, side, side, kernel, kernel, channels)
        found = gradient.new_zeros(ctx.shape, dtype=torch.float32)
        for row in range(kernel):
            for column in range(kernel):
                rows, columns = (slice(at, at + stride * side - stride + 1, stride) for at in (row, column))
                found[:, rows, columns] += windows[:, :, :, row, column]
        return found.to(ctx.dtype), None


def make_stacked_q(network: DuelingNetwork, dtype: torch.dtype = torch.float32) -> StackedQ:
    """Make the function that computes the Q-values of stacked networks.

    Args:
        network: one like all of them; its weights are not used.
        dtype: of the layers below `shared`, if these are conv layers; else all layers compute in float32.
    """
    if not network.geometry:
        return vmap(lambda parameters, seen: functional_call(network, dict(parameters), (seen,)))

    def q_values(parameters: Parameters, pixels: Tensor) -> Tensor:
        x = pixels.flatten(0, 1).permute(0, 2, 3, 1).to(dtype)
        for name, layer in zip(network.layer_names, network.geometry, strict=True):
            windows = x.flatten(1) if layer.whole else Windows.apply(x, layer)
            weight, bias = layer_of(name, parameters)
            # The order of a window: rows, columns, channels.
            weight = weight.permute(0, 1, 3, 4, 2).flatten(2)
            if name == network.layer_names[0]:  # pixels are from 0 to 255: fewer weights than pixels
                weight = weight / 255
            weight, bias = weight.to(dtype), bias.to(dtype)
            x = F.relu(linear(windows.unflatten(0, (len(bias), -1)), weight, bias))
            x = x.view(-1, layer.side, layer.side, layer.filters)
        hidden = x.float().view(*pixels.shape[:2], -1)
        hidden = F.relu(linear(hidden, *layer_of("shared", parameters)))
        value, advantage = (linear(hidden, *layer_of(name, parameters)) for name in ("value", "advantage"))
        return value + advantage - advantage.mean(-1, keepdim=True)

    return q_values


def linear(inputs: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Apply a linear layer of each network: inputs [K, B, I], weight [K, O, I] and bias [K, O]."""
    return torch.baddbmm(bias[:, None], inputs, weight.mT)


def layer_of(name: str, parameters: Parameters) -> tuple[Tensor, Tensor]:
    """Return the stacked weight and bias of a layer."""
    return parameters[f"{name}.weight"], parameters[f"{name}.bias"]
