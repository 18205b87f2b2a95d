"""Replay of states: pixels are drawn when a batch is learned from.

The picture is a function of the state, so 50,000 transitions take about 2 MB instead of 0.7 GB.
"""

from __future__ import annotations

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor
from torchrl.data import LazyTensorStorage, ReplayBuffer

# So that a long warm-up holds little that is not yet stored.
MOST_WAITING = 256


class StateReplay:
    """Uniform replay of `capacity` transitions.

    Args:
        capacity: the oldest beyond it are forgotten.
        reward_scale: rewards are multiplied by it.
        generator: source of the draws.
        device: where transitions lie.
        observed: which entry of a step is kept: `state`, or `features` where some layers are frozen.
    """

    def __init__(
        self,
        capacity: int,
        reward_scale: float,
        generator: Generator,
        device: torch.device,
        observed: str = "state",
    ) -> None:
        self.reward_scale, self.observed = reward_scale, observed
        self.buffer = ReplayBuffer(storage=LazyTensorStorage(capacity, device=device), generator=generator)
        # Storing one step costs as much as storing many, so they wait until a batch is drawn.
        self._waiting: list[dict[str | tuple[str, str], Tensor]] = []

    def __len__(self) -> int:
        self._store()
        return len(self.buffer)

    def extend(self, steps: TensorDictBase) -> None:
        """Store steps of N environments, tensordict [N] with the observed entry, `action` and `next`."""
        following = steps["next"]
        self._waiting.append(
            {
                self.observed: steps[self.observed],
                "action": steps["action"],
                ("next", self.observed): following[self.observed],
                ("next", "reward"): following["reward"] * self.reward_scale,
                ("next", "done"): following["done"],
                ("next", "terminated"): following["terminated"],
            }
        )
        if len(self._waiting) == MOST_WAITING:
            self._store()

    def _store(self) -> None:
        if self._waiting:
            kept = {key: torch.cat([step[key] for step in self._waiting]) for key in self._waiting[0]}
            stored = TensorDict(batch_size=kept["action"].shape)
            for key, values in kept.items():
                stored[key] = values
            self.buffer.extend(stored)
            self._waiting.clear()

    def sample(self, batch_size: int) -> TensorDictBase:
        """Draw transitions uniformly, with replacement.

        Returns:
            A tensordict [batch_size] with TorchRL's keys: the observed entry, also of `next`, [B, S],
            `action` [B], and of `next` `reward` (scaled), `done` and `terminated` [B, 1].
        """
        self._store()
        return self.buffer.sample(batch_size)
