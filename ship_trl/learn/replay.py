"""Replay of states: pixels are drawn when a batch is learned from.

The picture is a function of the state, so 50,000 transitions take about 2 MB instead of 0.7 GB.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase
from torch import Generator, Tensor
from torchrl.data import ReplayBuffer, RoundRobinWriter, Storage, TensorDictReplayBuffer
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


class TransitionStorage(Storage):
    """Rows of one tensor an entry: a `LazyTensorStorage` that stores transitions in a third of its time.

    A few transitions a time are written and a small batch is read, so that the time goes into looking
    after tensordicts, not into moving numbers.

    Args:
        capacity: transitions.
        device: where they lie.
    """

    def __init__(self, capacity: int, device: torch.device) -> None:
        super().__init__(capacity)
        self.device = device
        self._rows: dict[NestedKey, Tensor] = {}
        self._len = 0

    def __len__(self) -> int:
        return self._len

    def set(self, cursor: Any, data: TensorDictBase, *, set_cursor: bool = True) -> None:
        """Write transitions [K] to the rows `cursor` [K], or one to a row.

        The first ones say which entries there are.
        """
        if not self._rows:
            for key, value in data.items(True, True):
                shape = (self.max_size, *value.shape[data.batch_dims :])
                self._rows[key] = value.new_zeros(shape, device=self.device)
        for key, rows in self._rows.items():
            rows[cursor] = data.get(key)
        if set_cursor:
            self._set_last_cursor(cursor)
            last = int(cursor.max()) if isinstance(cursor, Tensor) else int(cursor)
            self._len = max(self._len, last + 1)
        self._bump_mutation_revision()

    def get(self, index: Any) -> TensorDict:
        """Read the rows `index` [B] as a tensordict [B]."""
        return nested({key: rows[: self._len][index] for key, rows in self._rows.items()}, self.device)

    def state_dict(self) -> dict[str, Any]:
        """Give the transitions and how many there are."""
        return {"rows": {key: rows.clone() for key, rows in self._rows.items()}, "length": self._len}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self._rows = {key: rows.to(self.device, copy=True) for key, rows in state_dict["rows"].items()}
        self._len = state_dict["length"]

    def dumps(self, path: Any) -> None:
        """Refuse: `state_dict` gives what is held."""
        raise NotImplementedError("transitions are not dumped; keep state_dict()")

    def loads(self, path: Any) -> None:
        """Refuse: `load_state_dict` takes what `state_dict` gave."""
        raise NotImplementedError("transitions are not dumped; use load_state_dict()")

    def _empty(self) -> None:
        self._len = 0


def as_drawn(batch: TensorDict) -> TensorDict:
    """Give a batch as the storage does."""
    return batch


def nested(entries: dict[NestedKey, Tensor], device: torch.device | None = None) -> TensorDict:
    """Make a tensordict [B] of entries [B, ...], those of `next` in one of their own."""
    outer: dict[str, Any] = {}
    following: dict[str, Any] = {}
    for key, value in entries.items():
        if isinstance(key, tuple):
            following[key[1]] = value
        else:
            outer[key] = value
    size = outer["action"].shape
    outer["next"] = TensorDict(following, batch_size=size, device=device)
    return TensorDict(outer, batch_size=size, device=device)


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
        batch_size: of `sample()` without a size, and of iteration.
    """

    def __init__(
        self,
        capacity: int,
        reward_scale: float,
        generator: Generator,
        device: torch.device,
        observation: str = "state",
        transform: Transform | None = None,
        batch_size: int | None = None,
    ) -> None:
        # Storing one step costs as much as storing many, so they wait until a batch is drawn.
        self._waiting: list[dict[str | tuple[str, str], Tensor]] = []
        self.reward_scale, self.observation = reward_scale, observation
        storage, writer = TransitionStorage(capacity, device), RoundRobinWriter()
        super().__init__(
            storage=storage,
            writer=writer,
            collate_fn=as_drawn,
            generator=generator,
            transform=transform,
            batch_size=batch_size,
        )

    def __len__(self) -> int:
        self._store()
        return super().__len__()

    def extend(self, tensordicts: TensorDictBase, **_: object) -> None:
        """Keep steps of N environments, tensordict [N] with the observation, `action` and `next`."""
        following = tensordicts.get("next")
        # Copies: what was given may be written to before it is stored.
        self._waiting.append(
            {
                self.observation: tensordicts.get(self.observation).clone(),
                "action": tensordicts.get("action").clone(),
                ("next", self.observation): following.get(self.observation).clone(),
                ("next", "reward"): following.get("reward") * self.reward_scale,
                ("next", "done"): following.get("done").clone(),
                ("next", "terminated"): following.get("terminated").clone(),
            }
        )
        if len(self._waiting) == MOST_WAITING:
            self._store()

    def add(self, data: TensorDictBase) -> None:
        """Keep one step."""
        self.extend(data.unsqueeze(0))

    def empty(self, *arguments: Any, **how: Any) -> None:
        """Forget everything."""
        self._waiting.clear()
        super().empty(*arguments, **how)

    def state_dict(self) -> dict[str, Any]:
        """Give everything that is kept."""
        self._store()
        return dict(super().state_dict())

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take over what `state_dict` gave, and nothing else."""
        self._waiting.clear()
        super().load_state_dict(state_dict)

    def __getitem__(self, index: Any) -> Any:
        self._store()
        return super().__getitem__(index)

    def _store(self) -> None:
        if self._waiting:
            kept = {key: torch.cat([step[key] for step in self._waiting]) for key in self._waiting[0]}
            self._waiting.clear()
            # A `TensorDictReplayBuffer` would note each transition's index beside it.
            ReplayBuffer.extend(self, nested(kept))

    def sample(self, batch_size: int | None = None, return_info: bool = False) -> TensorDictBase:
        """Draw so many transitions."""
        self._store()
        # Uniform draws have no use for the index that a `TensorDictReplayBuffer` adds.
        batch: TensorDictBase = ReplayBuffer.sample(self, batch_size, return_info)
        return batch
