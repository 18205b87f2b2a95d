"""Gradual unfreezing: copied layers thaw one by one, the last one first (ULMFiT; Howard and Ruder, 2018).

There a layer thaws with each epoch; here they thaw at equal distances, up to the share `period` of the
episodes. That is our choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ship_trl.config.arm import ALL_LAYERS, Form
from ship_trl.config.bounds import PositiveShare
from ship_trl.transfer.methods.base import TransferMethod

if TYPE_CHECKING:
    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.transfer.weights import Weights


@dataclass(frozen=True)
class Settings:
    """When copied layers thaw."""

    period: PositiveShare = 0.5


FORM = Form("GU", (ALL_LAYERS,), settings=Settings)


class Method(TransferMethod):
    """Copies the arm's layers, freezes them, and thaws them from the last one down."""

    settings: Settings
    _frozen = 0

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source; of those that can be frozen, all are at first."""
        super().copy(network, weights)
        copied = self.arm.copied(network.all_layers, network.layer_names)
        self._frozen = sum(name in copied for name in network.layer_names)

    def frozen_layers(self, progress: float) -> int:
        """Return how many layers are frozen at a share of the episodes."""
        thawed = int(self._frozen * progress / self.settings.period)
        return max(0, self._frozen - thawed)
