"""Gradual unfreezing: copied layers thaw one by one, the last one first (ULMFiT; Howard and Ruder, 2018).

There a layer thaws with each epoch; here they thaw at equal distances, up to the share `period` of the
episodes. That is our choice.
"""

from __future__ import annotations

from ship_trl.learn.network import DuelingNetwork
from ship_trl.transfer.methods.base import TransferMethod
from ship_trl.transfer.weights import Weights


class Unfreeze(TransferMethod):
    """Copies the arm's layers, freezes them, and thaws them from the last one down."""

    _frozen = 0

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source; of those that can be frozen, all are at first."""
        super().copy(network, weights)
        copied = self.arm.copied(network.all_layers, network.layer_names)
        self._frozen = sum(name in copied for name in network.layer_names)

    def frozen_layers(self, progress: float) -> int:
        """Return how many layers are frozen at a share of the episodes."""
        thawed = int(self._frozen * progress / self.settings.unfreeze.period)
        return max(0, self._frozen - thawed)
