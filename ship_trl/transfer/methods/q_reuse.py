"""Q-value reuse: the source's Q-values are added to those of a fresh network (Taylor and Stone, 2007).

The source's network does not learn; the fresh one learns what is missing from the sum. Its own Q-values begin
with 0, so that the sum begins as the source. That is our choice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ship_trl.config.arm import OUTPUT, Form
from ship_trl.transfer.methods.base import TransferMethod, fixed_copy

if TYPE_CHECKING:
    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.transfer.weights import Weights

FORM = Form("QR", (), bare=True, uses_function=True)


class Method(TransferMethod):
    """Copies the arm's layers, if any, and adds the source's Q-values."""

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source, and let the network begin as the source's function."""
        super().copy(network, weights)
        source = fixed_copy(network, weights)
        # Q-values are linear in the output layers, so these take the factor between the rewards.
        factor = self._origin.reward_scale / self._origin.source_scale
        for name in OUTPUT:
            for fresh, fixed in zip(
                getattr(network, name).parameters(), getattr(source, name).parameters(), strict=True
            ):
                fresh.data.zero_()
                fixed.data.mul_(factor)
        network.reused = source
