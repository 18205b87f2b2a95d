"""Replay of states: pixels are drawn when a batch is learned from.

The picture is a function of the state, so 50,000 transitions take about 2 MB instead of 0.7 GB.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor
from torchrl.data import LazyTensorStorage, ReplayBuffer, TensorDictReplayBuffer
from torchrl.envs.transforms import Transform

# So that a long warm-up holds little that is not yet stored.
MOST_WAITING = 256


class DrawPixels(Transform):
    """Puts `pixels` beside each `state`, also of `next`, in batches of a replay buffer.

    Args:
        draw: states [..., S] to uint8 [..., C, 84, 84].
    """

    def __init__(self, draw: Callable[[Tensor], Tensor]) -> None:
        super().__init__(in_keys=["state", ("next", "state")], out_keys=["pixels", ("next", "pixels")])
        self.draw = draw

    def _apply_transform(self, obs: Tensor) -> Tensor:
        return self.draw(obs)


class StateReplay(TensorDictReplayBuffer):
    """Uniform replay of `capacity` transitions, a `TensorDictReplayBuffer` with TorchRL's keys.

    A batch [B] has the observation and that of `next`, [B, ...], `action` [B], and of `next` `reward`
    (scaled), `done` and `terminated` [B, 1]. Draws are uniform, with replacement.

    Args:
        capacity: the oldest beyond it are forgotten.
        reward_scale: rewards are multiplied by it.
        generator: source of the draws.
        device: where transitions lie.
        observation: which entry of a step is kept: `state`, or `features` where some layers are frozen.
        transform: of batches, as `DrawPixels`.
    """

    def __init__(
        self,
        capacity: int,
        reward_scale: float,
        generator: Generator,
        device: torch.device,
        observation: str = "state",
        transform: Transform | None = None,
    ) -> None:
        # Storing one step costs as much as storing many, so they wait until a batch is drawn.
        self._waiting: list[dict[str | tuple[str, str], Tensor]] = []
        self.reward_scale, self.observation = reward_scale, observation
        storage = LazyTensorStorage(capacity, device=device)
        super().__init__(storage=storage, generator=generator, transform=transform)

    def __len__(self) -> int:
        self._store()
        return super().__len__()

    def extend(self, tensordicts: TensorDictBase, **_: object) -> None:
        """Keep steps of N environments, tensordict [N] with the observation, `action` and `next`."""
        following = tensordicts["next"]
        self._waiting.append(
            {
                self.observation: tensordicts[self.observation],
                "action": tensordicts["action"],
                ("next", self.observation): following[self.observation],
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
            self._waiting.clear()
            ReplayBuffer.extend(self, stored)

    def sample(self, batch_size: int | None = None, return_info: bool = False) -> TensorDictBase:
        """Draw so many transitions."""
        self._store()
        # Uniform draws have no use for the index that a `TensorDictReplayBuffer` adds.
        batch: TensorDictBase = ReplayBuffer.sample(self, batch_size, return_info)
        return batch
