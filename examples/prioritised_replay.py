"""Prioritised replay (Schaul et al., 2016) by TorchRL's sampler: large errors are learned from more often.

    python -m ship_trl target=2 method=scratch algorithm.build=examples/prioritised_replay.py:build \
        +algorithm.alpha=0.6 +algorithm.beta=0.4 profile=smoke

The sampler needs TorchRL's C++ extension, which loads with torch 2.14.1 and not with torch 2.13.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import PrioritizedSampler

from ship_trl.config.errors import ConfigError
from ship_trl.learn.algorithm import Setup
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.q_learning import td_target
from ship_trl.learn.replay import StateReplay


class Sampler(PrioritizedSampler):
    """A sampler that gives new transitions the largest priority so far."""

    def extend(self, index: Any) -> None:
        """Take note of new transitions."""
        super().extend(index)
        self.update_priority(index, self.default_priority)


class PrioritisedReplay(StateReplay):
    """Replay whose batches have `index` [B] and importance `weight` [B, 1]; see `StateReplay`."""

    def __init__(self, sampler: Sampler, *arguments: Any, **others: Any) -> None:
        super().__init__(*arguments, **others)
        self.set_sampler(sampler)
        self.set_rng(self.generator)

    def sample(self, batch_size: int | None = None, return_info: bool = False) -> TensorDictBase:
        """Draw a batch of transitions."""
        batch, info = super().sample(batch_size, return_info=True)
        weight = info["priority_weight"].to(torch.float32).unsqueeze(-1)
        return batch.update({"index": info["index"], "weight": weight})

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs: that of uniform replay, and the priorities."""
        state = super().state_dict()
        largest = torch.as_tensor(self.sampler.default_priority, dtype=torch.float32)
        tree = self.sampler._sum_tree  # noqa: SLF001
        priorities = torch.as_tensor(tree[torch.arange(len(self))])
        return state | {"priorities": priorities, "largest": largest}

    def load_state_dict(self, state_dict: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned."""
        super().load_state_dict(state_dict)
        for tree in (self.sampler._sum_tree, self.sampler._min_tree):  # noqa: SLF001
            tree[torch.arange(len(state_dict["priorities"]))] = state_dict["priorities"]
        self.sampler._max_priority = (state_dict["largest"], None)  # noqa: SLF001


class PrioritisedDQN(DoubleDQN):
    """Double DQN with the weights of the transitions; it sets the priorities of a batch to its errors."""

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Return the mean of the squared errors times the weights, and write `td_error` [B, 1]."""
        key, following = self.observed, batch["next"]
        with torch.no_grad():
            both = self.online_network(following[key]), self.target_network(following[key])
            wanted = td_target(*both, following["reward"], following["terminated"], self.learn.gamma)
        error = self.online_network(batch[key]).gather(-1, batch["action"].unsqueeze(-1)) - wanted
        batch.set("td_error", error.detach().abs())
        return (batch["weight"] * error.square()).mean()

    def learn_from(self, batch: TensorDictBase) -> Tensor:
        """Take one gradient step on a batch, and return the loss."""
        loss = super().learn_from(batch)
        self.replay.update_priority(batch["index"], batch["td_error"].squeeze(-1))
        return loss


def build(setup: Setup) -> DoubleDQN:
    """Make double DQN with prioritised replay.

    Raises:
        ConfigError: TorchRL's extension does not load.
    """
    alpha, beta = (float(setup.options.get(key, value)) for key, value in (("alpha", 0.6), ("beta", 0.4)))
    try:
        sampler = Sampler(setup.learn.replay_size, alpha, beta)
    except RuntimeError:
        raise ConfigError(
            f"algorithm.build: prioritised replay needs TorchRL's C++ extension, which does not load with "
            f"torch {torch.__version__}; allowed: torch 2.14.1, or another algorithm"
        ) from None
    return PrioritisedDQN(setup, make_replay=partial(PrioritisedReplay, sampler))
