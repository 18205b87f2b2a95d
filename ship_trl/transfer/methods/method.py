"""What every method of transfer answers; a method overrides what it does otherwise."""

from __future__ import annotations

from ship_trl.config.arm import Arm
from ship_trl.learn.algorithm import Method
from ship_trl.learn.network import DuelingNetwork
from ship_trl.transfer.layers import Weights


class TransferMethod(Method):
    """Copy the arm's layers, and let every layer learn.

    Args:
        arm: which layers are copied.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm

    def copy(self, network: DuelingNetwork, weights: Weights) -> None:
        """Copy layers of the source into the network, without freezing them."""
        copied = network.layer_names[: self.arm.copied_layers(len(network.layer_names))]
        for key, parameter in network.named_parameters():
            if self.arm.copies_all or key.split(".")[0] in copied:
                parameter.data.copy_(weights[key])
