"""Floating point operations of the paper's network, counted from its layers' shapes."""

from __future__ import annotations

from dataclasses import dataclass

from torch import nn

from ship_trl.bench.work import CONV_LAYERS
from ship_trl.sim.scene import SIZE


@dataclass(frozen=True)
class Layer:
    """A layer by its operations for one picture, a multiplication and an addition counted apart."""

    name: str
    flops: int


def layers_of(network: nn.Module, size: int = SIZE) -> list[Layer]:
    """Return the conv and linear layers of a network, in the order of its attributes.

    The conv layers follow each other from a picture of `size` x `size` without padding.
    """
    found = []
    for name, layer in network.named_modules():
        if isinstance(layer, nn.Conv2d):
            size = (size - layer.kernel_size[0]) // layer.stride[0] + 1
            found.append(Layer(name, 2 * layer.weight.numel() * size * size))
        elif isinstance(layer, nn.Linear):
            found.append(Layer(name, 2 * layer.weight.numel()))
    return found


def forward_flops(layers: list[Layer], batch: int) -> int:
    """One pass of `batch` pictures forwards."""
    return batch * sum(layer.flops for layer in layers)


def update_flops(layers: list[Layer], batch: int, frozen: int = 0, double: bool = True) -> int:
    """Return what one double-DQN update cannot do without, the first `frozen` conv layers being fixed.

    Forwards: the online network on the pictures and on the next ones, the target network on the
    next ones; without `double` the online network does not see those. Frozen layers are the same
    in both networks, so the next pictures pass them once.
    Backwards: each layer that learns needs the gradient of its weights, and every one above the
    lowest of them that of its input too. Biases, ReLU and the optimiser are left out, as is usual.

    Raises:
        ValueError: `frozen` is not 0 to 4.
    """
    if not 0 <= frozen <= CONV_LAYERS:
        raise ValueError(f"frozen: must be 0 to {CONV_LAYERS}, got {frozen}")
    fixed, learning = layers[:frozen], layers[frozen:]
    forwards = 2 * forward_flops(fixed, batch) + (3 if double else 2) * forward_flops(learning, batch)
    return forwards + backward_flops(learning, batch)


def backward_flops(learning: list[Layer], batch: int) -> int:
    """Gradients of weights and inputs; the two heads share one input, and both give it a gradient."""
    return 2 * forward_flops(learning, batch) - forward_flops(learning[:1], batch)
