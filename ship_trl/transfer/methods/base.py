"""What every method of transfer answers; a method overrides what it does otherwise."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ship_trl.config.arm import Arm
from ship_trl.learn.hooks import LearningHooks

if TYPE_CHECKING:
    from torch import Generator, Tensor

    from ship_trl.learn.network import Draw, DuelingNetwork
    from ship_trl.transfer.weights import Weights


@dataclass(frozen=True)
class Origin:
    """The source as a function, for methods that use more than its weights.

    Attributes:
        network: the source's network, which does not learn.
        draw: maps states to its input.
        generator: random generator of the method, on the device.
        episode_return: mean greedy return of the source's network on the target.
        untrained_return: mean greedy return of the target's network before anything is copied.
        source_scale: factor of the rewards that the source's Q-values sum.
        reward_scale: the same of the target's.
    """

    network: DuelingNetwork
    draw: Draw
    generator: Generator
    episode_return: float
    untrained_return: float
    source_scale: float = 1.0
    reward_scale: float = 1.0

    def q_values(self, state: Tensor) -> Tensor:
        """Compute the source's Q-values [N, A] of states [N, S]."""
        return self.network(self.draw(state))


def fixed_copy(network: DuelingNetwork, weights: Weights) -> DuelingNetwork:
    """Return a network of the same layers that holds the weights and does not learn."""
    from ship_trl.learn.network import Dense

    other = copy.deepcopy(network).requires_grad_(False)
    other.load_state_dict(dict(weights))
    other.backend = Dense()
    return other


class TransferMethod(LearningHooks):
    """Copy the arm's layers, from scratch none, and let every layer learn.

    Args:
        arm: which layers are copied.

    Attributes:
        settings: of the class that the method's `FORM` names.
    """

    settings: Any
    _origin: Origin

    def __init__(self, arm: Arm) -> None:
        self.arm = arm

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source into the network, without freezing them."""
        copied = self.arm.copied(network.all_layers, network.layer_names)
        for key, parameter in network.named_parameters():
            if key.split(".")[0] in copied:
                parameter.data.copy_(weights[key])

    def attach(self, origin: Origin) -> None:
        """Take the source's function, which methods that use it need before they learn."""
        self._origin = origin
