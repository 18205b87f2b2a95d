"""Double DQN with n-step targets (Sutton 1988): several rewards before the target bootstraps.

A value then travels n steps back in an update. As in Rainbow (Hessel et al., 2018), actions between are not
corrected for. Targets are summed when a batch is drawn, so a checkpoint holds nothing further.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Writer

from ship_trl.learn import double_dqn
from ship_trl.learn.algorithm import Setup
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.loss import STEPS
from ship_trl.learn.replay import StateReplay, TransitionStorage, make_batch

# How many rows later the same environment's next transition is stored.
STRIDE = "stride"
NEXT_REWARD, NEXT_DONE = ("next", "reward"), ("next", "done")


class NStepStorage(TransitionStorage):
    """Storage whose batches look up to `steps` transitions ahead, to the end of the episode at most.

    `reward` is the discounted sum, `next` is what follows the last transition, and `steps_to_next_obs`
    [B, 1] counts the transitions.
    """

    steps: int
    gamma: float
    writer: Writer

    def get(self, index: Any) -> TensorDict:
        """Read the rows `index` [B] as a tensordict [B]."""
        rows = {key: values[: self._len] for key, values in self._rows.items()}
        index = torch.arange(self._len, device=self.device)[index]
        newest = (self.writer._cursor - 1) % self.max_size  # noqa: SLF001
        last, reward = index, rows[NEXT_REWARD][index].clone()
        count, goes_on = torch.ones_like(index), ~rows[NEXT_DONE][index].squeeze(-1)
        for step in range(1, self.steps):
            stride = rows[STRIDE][last]
            # Transitions that are not stored yet are left out: the target bootstraps earlier.
            goes_on = goes_on & ((newest - last) % self.max_size >= stride)
            last = torch.where(goes_on, (last + stride) % self.max_size, last)
            reward += self.gamma**step * rows[NEXT_REWARD][last] * goes_on[:, None]
            count, goes_on = count + goes_on, goes_on & ~rows[NEXT_DONE][last].squeeze(-1)
        shown: dict[NestedKey, Tensor] = {
            key: values[index if isinstance(key, str) else last]
            for key, values in rows.items()
            if key not in self.hidden and key != STRIDE
        }
        return make_batch(shown | {NEXT_REWARD: reward, STEPS: count[:, None]}, self.device)


class NStepReplay(StateReplay):
    """Uniform replay whose batches have the rewards of several steps; see `StateReplay`.

    Args:
        steps: n.
        gamma: discount per step.
        arguments: those of `StateReplay`.
    """

    def __init__(self, steps: int, gamma: float, *arguments: Any, **others: Any) -> None:
        super().__init__(*arguments, **{**others, "make_storage": NStepStorage})
        storage: Any = self._storage
        storage.steps, storage.gamma, storage.writer = steps, gamma, self._writer

    def entries(self, step: TensorDictBase) -> dict[NestedKey, Tensor]:
        """Return what is stored of a step of N environments, which stand one behind the other."""
        count = step.batch_size[0]
        return super().entries(step) | {STRIDE: torch.full((count,), count, device=step.device)}


def build(setup: Setup) -> DoubleDQN:
    """Make double DQN with targets of `setup.options["steps"]` rewards."""
    make_replay = partial(NStepReplay, setup.options["steps"], setup.learn.gamma)
    return double_dqn.build(setup, make_replay)
