"""L2-SP: copied weights are regularised towards the source's (Li, Grandvalet and Davoine, 2018).

With a weight of 0 this is finetuning, and with a large one nearly feature extraction. With `rate_decay` the
lower copied layers also learn slower than the upper ones (ULMFiT; Howard and Ruder, 2018).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from ship_trl.config.arm import OUTPUT, Form
from ship_trl.config.bounds import LossWeight
from ship_trl.transfer.methods.base import TransferMethod

if TYPE_CHECKING:
    from tensordict import TensorDictBase
    from torch import Tensor, nn

    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.transfer.weights import Weights


@dataclass(frozen=True)
class Settings:
    """How strongly weights are pulled: copied ones to the source's, fresh ones to zero; how fast they learn.

    The learning rate of a copied layer is that of the layer above it, divided by `rate_decay`.
    """

    copied: LossWeight = 0.01
    fresh: LossWeight = 0.0
    rate_decay: Annotated[float, Field(ge=1, le=1000)] = 1.0


FORM = Form("SP", settings=Settings)


class Method(TransferMethod):
    """Adds copied / 2 * |w - w_source|^2 of copied weights to the loss, and fresh / 2 * |w|^2 of others."""

    settings: Settings
    _start: dict[str, Tensor]
    _factors: dict[str, float]

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source, and keep their weights for the penalty."""
        super().copy(network, weights)
        copied = self.arm.copied(network.all_layers, network.layer_names)
        named = network.named_parameters()
        self._start = {key: value.detach().clone() for key, value in named if key.split(".")[0] in copied}
        self._factors, factor = {}, 1.0
        for name in reversed(network.all_layers):
            if name not in OUTPUT:  # value and advantage are the top, side by side
                factor = factor / self.settings.rate_decay if name in copied else 1.0
            self._factors[name] = factor

    def rate_factor(self, layer: str) -> float:
        """Return 1 for fresh and output layers, and a copied layer's share of the full learning rate."""
        return self._factors[layer]

    def penalty(self, network: nn.Module, batch: TensorDictBase) -> Tensor | None:
        """Return the penalty, or None where both weights are 0."""
        import torch

        settings, terms = self.settings, []
        for key, value in network.named_parameters():
            weight = settings.copied if key in self._start else settings.fresh
            if weight and value.requires_grad:
                change = value - self._start[key] if key in self._start else value
                terms.append(weight / 2 * change.square().sum())
        return torch.stack(terms).sum() if terms else None
