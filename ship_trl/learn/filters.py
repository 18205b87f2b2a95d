"""A network's conv layers as matrices that learn from batches of rows (see `delta`)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ship_trl.learn.delta import GatheredLayer, Rows
from ship_trl.learn.network import CONV_NAMES, DuelingNetwork


def conv_layers(network: DuelingNetwork) -> list[nn.Conv2d]:
    """conv1 to conv4."""
    return [getattr(network, name) for name in CONV_NAMES]


def as_matrices(layer: nn.Conv2d) -> tuple[Tensor, Tensor]:
    """Views of a layer's filters [O, C, H, W] as a matrix [O, H W C], and of its biases [O].

    Raises:
        RuntimeError: the filters do not lie channels last, so that only a copy could be given.
    """
    assert layer.bias is not None
    weight = layer.weight.detach().permute(0, 2, 3, 1)
    return weight.view(len(weight), -1), layer.bias.detach()


class Filters:
    """The conv layers of a network as matrices, copied into the precision that computes.

    `parameters` are the network's own weights, without the frozen layers: in float32, as matrices
    that share its memory. Gradients are taken on the copies and handed back to them.

    Args:
        network: float32, on the CPU.
        dtype: what the conv layers compute in.
        frozen: how many layers, counted from the image, never change.
    """

    def __init__(self, network: DuelingNetwork, dtype: torch.dtype, frozen: int) -> None:
        self.dueling = network.dueling
        layers = [as_matrices(layer) for layer in conv_layers(network)]
        weights, biases = [weight for weight, _ in layers], [bias for _, bias in layers]
        self.weights = [weight.to(dtype, copy=True) for weight in weights]
        self.biases = [bias.to(dtype, copy=True) for bias in biases]
        own, copies = weights[frozen:] + biases[frozen:], self.weights[frozen:] + self.biases[frozen:]
        self._pairs = list(zip(own, copies, strict=True))
        heads = (network.shared, network.value, network.advantage)
        self.parameters = own + [parameter for head in heads for parameter in head.parameters()]

    def learn(self) -> None:
        """Record what gradients need, from the next Q-values on."""
        for _, copy in self._pairs:
            copy.requires_grad_()

    @torch.no_grad()
    def refresh(self) -> None:
        """Copy the weights anew, after the network's have changed."""
        for master, copy in self._pairs:
            copy.copy_(master)

    def hand_back(self) -> None:
        """Give the gradients of the copies to `parameters`."""
        for master, copy in self._pairs:
            assert copy.grad is not None
            master.grad, copy.grad = copy.grad.float(), None

    def advance(self, rows: Rows, layers: int) -> Rows:
        """Through the next `layers` conv layers."""
        values, indices = rows
        first = len(CONV_NAMES) - len(indices)
        for n in range(first, first + layers):
            values = GatheredLayer.apply(values, indices[n - first], self.weights[n], self.biases[n])
        return Rows(values, indices[layers:])

    def q_values(self, rows: Rows) -> Tensor:
        """Q-values of B frames, float32 [B, A].

        The fully connected layers compute in float32: there the differences between actions are small.
        """
        return self.dueling(self.advance(rows, len(rows.indices)).values.float())
