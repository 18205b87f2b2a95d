"""Controls: source weights without what the source learned. Our choice; the paper has none."""

from __future__ import annotations

import torch
from torch import Generator

from ship_trl.learn.network import DuelingNetwork
from ship_trl.transfer.layers import Weights


def random_weights(network: DuelingNetwork, generator: Generator) -> Weights:
    """Return the weights of an untrained network of the same layers."""
    network.reset(generator)
    return network.state_dict()


def permute_values(weights: Weights, generator: Generator) -> Weights:
    """Shuffle the values within each weight and bias tensor, which keeps their scale but no features."""
    permuted = {}
    for name in sorted(weights):
        value = weights[name]
        order = torch.randperm(value.numel(), generator=generator)
        permuted[name] = value.flatten()[order].reshape(value.shape)
    return permuted
