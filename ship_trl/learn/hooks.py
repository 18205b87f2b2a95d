"""What a method of transfer changes in learning. No torch, so that its settings are checked before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tensordict import TensorDictBase
    from torch import Tensor, nn


class LearningHooks:
    """Hooks of a method of transfer; the defaults change nothing."""

    def frozen_layers(self, progress: float) -> int:
        """Return how many layers, counted from the input, do not learn at a share of the episodes."""
        return 0

    def rate_factor(self, layer: str) -> float:
        """Return the factor of the learning rate of a layer of the network."""
        return 1.0

    def penalty(self, network: nn.Module, batch: TensorDictBase) -> Tensor | None:
        """Return what is added to the loss of a batch, or None for nothing.

        A batch holds at least what the network observes, under the network's key.
        """
        return None

    def act(self, step: TensorDictBase, progress: float) -> None:
        """Change `action` [N] of a step, which the exploring policy has chosen; `progress` as above."""

    def observe(self, step: TensorDictBase) -> None:
        """Take note of a step [N] of the environment, with `action` and `next`."""

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to go on with the same bits; tensors are not copied."""
        return {}

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned."""
