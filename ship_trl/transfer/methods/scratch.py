"""Learning from scratch: nothing is copied, and everything learns."""

from __future__ import annotations

from ship_trl.learn.network import DuelingNetwork
from ship_trl.transfer.layers import Weights
from ship_trl.transfer.methods.method import TransferMethod


class Scratch(TransferMethod):
    """Copies nothing."""

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Leave the network as it is."""
