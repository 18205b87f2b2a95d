"""What computes conv layers: the interface, and the plain way, every layer on every pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import torch
from torch import Tensor

if TYPE_CHECKING:
    from ship_trl.learn.network import DuelingNetwork


class Backend(Protocol):
    """Computes the conv layers in a number format. It holds no weights, so networks may share it."""

    name: str
    dtype: torch.dtype

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to float32 [B, F]."""
        ...

    def features_from(self, network: DuelingNetwork, frozen_features: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones: [B, K] to float32 [B, F]."""
        ...


class Dense:
    """Backend for any device that computes every layer on every pixel, without caches.

    Args:
        dtype: of the conv layers; bfloat16 uses autocast, weights and gradients stay float32.
    """

    name = "dense"

    def __init__(self, dtype: torch.dtype = torch.float32) -> None:
        self.dtype = dtype

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers."""
        with torch.autocast(pixels.device.type, torch.bfloat16, enabled=self.dtype is torch.bfloat16):
            # The next layers compute in float32: Q-values may differ by less than bfloat16 resolves.
            return network.encode(pixels).float()

    def features_from(self, network: DuelingNetwork, frozen_features: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones."""
        with torch.autocast(frozen_features.device.type, torch.bfloat16, self.dtype is torch.bfloat16):
            return network.encode_from(frozen_features.float()).float()
