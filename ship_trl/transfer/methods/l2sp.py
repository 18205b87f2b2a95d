"""L2-SP: copied weights are regularised towards the source's (Li, Grandvalet and Davoine, 2018).

With a weight of 0 this is finetuning, and with a large one nearly feature extraction.
"""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from ship_trl.learn.network import DuelingNetwork
from ship_trl.transfer.layers import Weights
from ship_trl.transfer.methods.method import TransferMethod


class L2SP(TransferMethod):
    """Adds copied / 2 * |w - w_source|^2 of copied weights to the loss, and fresh / 2 * |w|^2 of others."""

    _start: dict[str, Tensor]

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source, and keep their weights for the penalty."""
        super().copy(network, weights)
        copied = self.arm.copied(network.all_layers, network.layer_names)
        named = network.named_parameters()
        self._start = {key: value.detach().clone() for key, value in named if key.split(".")[0] in copied}

    def penalty(self, network: nn.Module, batch: TensorDictBase) -> Tensor | None:
        """Return the penalty, or None where both weights are 0."""
        settings, terms = self.settings.l2sp, []
        for key, value in network.named_parameters():
            weight = settings.copied if key in self._start else settings.fresh
            if weight and value.requires_grad:
                change = value - self._start[key] if key in self._start else value
                terms.append(weight / 2 * change.square().sum())
        return torch.stack(terms).sum() if terms else None
