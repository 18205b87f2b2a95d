"""Feature extraction: the copied layers stay as the source learned them (section 3.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ship_trl.config.arm import HEAD, Form
from ship_trl.transfer.methods.base import TransferMethod

if TYPE_CHECKING:
    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.transfer.weights import Weights

FORM = Form("FE", (HEAD,))


class Method(TransferMethod):
    """Copies the arm's layers and freezes them.

    With `layers=head` the fully connected layers stay, and conv layers learn below them: our control, which
    asks what was transferred.
    """

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source, and freeze the fully connected ones if these are copied."""
        super().copy(network, weights)
        if self.arm.layers == HEAD:
            for name in self.arm.copied(network.all_layers, network.layer_names):
                getattr(network, name).requires_grad_(False)

    def frozen_layers(self, progress: float) -> int:
        """Return that the copied layers never learn."""
        return self.arm.frozen_layers
