"""Feature extraction: the copied layers stay as the source learned them (section 3.5)."""

from __future__ import annotations

from ship_trl.transfer.methods.method import TransferMethod


class FeatureExtraction(TransferMethod):
    """Copies the arm's layers and freezes them."""

    def frozen_layers(self, progress: float) -> int:
        """Return that the copied layers never learn."""
        return self.arm.frozen_layers
