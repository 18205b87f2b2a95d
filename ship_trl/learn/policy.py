"""Policies of a Q-network as TorchRL modules, which write `action` into a tensordict."""

from __future__ import annotations

from collections.abc import Callable

import torch
from tensordict import NestedKey, TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictSequential
from torch import Generator, Tensor
from torchrl.modules import QValueActor

from ship_trl.learn.network import DuelingNetwork


def greedy_policy(network: DuelingNetwork, draw: Callable[[Tensor], Tensor]) -> TensorDictSequential:
    """Return the policy that takes the action with the highest Q-value.

    It reads `state` [N, S] and writes the key that the network observes, `action_value` float32 [N, A],
    `chosen_action_value` [N, 1] and `action` int64 [N]. `draw` maps states to the network's input.
    """
    keys: list[NestedKey] = [network.observes]
    return TensorDictSequential(
        TensorDictModule(draw, in_keys=["state"], out_keys=keys),
        QValueActor(network, in_keys=keys, action_space="categorical"),
    )


class EpsilonGreedy(TensorDictModuleBase):
    """Writes `action` int64 [N]: with probability `epsilon` a random one, else the best.

    TorchRL's `EGreedyModule` draws from torch's global generator, and computes Q-values for every row. This
    module draws from the run's own generator, and on a CPU computes Q-values only for rows that do not
    explore. The number of draws does not depend on `epsilon`, which the training loop sets.

    `best` maps observations [N, ...], read from the key `observation`, to the best actions, int64 [N].
    """

    def __init__(
        self, best: Callable[[Tensor], Tensor], observation: str, num_actions: int, generator: Generator
    ) -> None:
        super().__init__()
        self.in_keys, self.out_keys = [observation], ["action"]
        self.best, self.num_actions, self.generator = best, num_actions, generator
        self.epsilon = 1.0

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Choose an action for each row."""
        observation = tensordict.get(self.in_keys[0])
        count, device = observation.shape[0], observation.device
        explore = torch.rand(count, generator=self.generator, device=device) < self.epsilon
        action = torch.randint(self.num_actions, (count,), generator=self.generator, device=device)
        if device.type == "cuda":
            # All rows: to know which ones explore would wait for all earlier operations.
            return tensordict.set("action", torch.where(explore, action, self.best(observation)))
        explorers = sum(explore.tolist())
        if explorers == 0:
            action = self.best(observation)
        elif explorers < count:
            action[~explore] = self.best(observation[~explore])
        return tensordict.set("action", action)
