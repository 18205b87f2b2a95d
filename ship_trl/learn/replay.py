"""Replay of states: pixels are drawn when a batch is learned from.

The picture is a function of the state, so 50,000 transitions take about 2 MB instead of 0.7 GB.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase, unravel_key
from torch import Generator, Tensor
from torchrl.data import ReplayBuffer, RoundRobinWriter, Storage, TensorDictReplayBuffer
from torchrl.envs.transforms import Transform

STATES: tuple[NestedKey, ...] = ("state", ("next", "state"))
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
        unread: entries that are kept and not given.
    """

    def __init__(
        self, capacity: int, device: torch.device, unread: frozenset[NestedKey] = frozenset()
    ) -> None:
        super().__init__(capacity)
        self.device, self.unread = device, unread
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
        given = {k: rows[: self._len][index] for k, rows in self._rows.items() if k not in self.unread}
        return nested(given, self.device)

    def rows(self) -> dict[NestedKey, Tensor]:
        """Give the entries that are held, [L, ...] each, unread ones too; not copies."""
        return {key: rows[: self._len] for key, rows in self._rows.items()}

    def load_rows(self, rows: Mapping[NestedKey, Tensor]) -> None:
        """Take over entries as `rows` gave them; further ones of as many rows may be written."""
        self._rows, self._len = {}, 0
        for key, value in rows.items():
            self._len = len(value)
            self._rows[key] = value.new_zeros((self.max_size, *value.shape[1:]), device=self.device)
            self._rows[key][: self._len] = value

    def write(self, key: NestedKey, number: int, value: Tensor) -> Tensor:
        """Write one row of an entry, and return it as it is held."""
        if key not in self._rows:
            self._rows[key] = value.new_zeros((self.max_size, *value.shape), device=self.device)
        self._rows[key][number] = value
        return self._rows[key][number]

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


def dotted(key: NestedKey) -> str:
    """Write a key as one word."""
    return key if isinstance(key, str) else ".".join(key)


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
        encode: states [N, S] to the observation [N, ...]. With it states are kept beside the observation,
            which `kept` leaves out and `load_kept` computes again: it takes a hundred times their room.
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
        encode: Callable[[Tensor], Tensor] | None = None,
    ) -> None:
        # Storing one step costs as much as storing many, so they wait until a batch is drawn.
        self._waiting: list[dict[str | tuple[str, str], Tensor]] = []
        self.reward_scale, self.observation = reward_scale, observation
        self.generator, self._encode = generator, encode
        unread = frozenset[NestedKey](STATES if encode is not None else ())
        storage, writer = TransitionStorage(capacity, device, unread), RoundRobinWriter()
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
        beside = STATES if self._encode is not None else ()
        # Copies: what was given may be written to before it is stored.
        self._waiting.append(
            {key: tensordicts.get(key).clone() for key in beside}
            | {
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

    def kept(self) -> dict[str, Tensor]:
        """Give what is needed to go on with just these transitions and draws, by dotted names.

        The tensors are the memory of the storage, not copies.
        """
        self._store()
        computed, writer = self._computed(), self._writer.state_dict()
        rows = {key: value for key, value in self._storage.rows().items() if key not in computed}
        return {
            **{f"rows.{dotted(key)}": value for key, value in rows.items()},
            "cursor": torch.tensor([writer["_cursor"], writer["_write_count"]]),
            "generator": self.generator.get_state(),
        }

    def load_kept(self, kept: Mapping[str, Tensor]) -> None:
        """Take over what `kept` gave; observations that it left out are computed again, one by one."""
        self._waiting.clear()
        named = {name.removeprefix("rows."): v for name, v in kept.items() if name.startswith("rows.")}
        rows: dict[NestedKey, Tensor] = {unravel_key(tuple(name.split("."))): v for name, v in named.items()}
        self._storage.load_rows(rows)
        if rows:
            self._compute(rows)
        cursor, count = kept["cursor"].tolist()
        self._writer.load_state_dict({"_cursor": cursor, "_write_count": count})
        self.generator.set_state(kept["generator"].cpu())

    def _computed(self) -> dict[NestedKey, NestedKey]:
        """Say which observations can be computed again, and from which states."""
        if self._encode is None:
            return {}
        return {self.observation: STATES[0], ("next", self.observation): STATES[1]}

    def _compute(self, rows: Mapping[NestedKey, Tensor]) -> None:
        """Compute observations again from the states among rows, straight to where they are stored."""
        # The state after one step is mostly the state before the next: where each was first written.
        known: dict[bytes, Tensor] = {}
        for key, source in self._computed().items():
            assert self._encode is not None
            for number, state in enumerate(rows[source].split(1)):
                name = state.cpu().numpy().tobytes()
                found = known[name] if name in known else self._encode(state)[0]
                known[name] = self._storage.write(key, number, found)

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
