"""Replay buffer of states, which draws pixels when a batch is sampled.

A frame is a function of the state, so 50,000 transitions take 4 to 10 MB instead of 0.7 GB.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase, unravel_key
from torch import Generator, Tensor
from torchrl.data import ReplayBuffer, RoundRobinWriter, Storage, TensorDictReplayBuffer
from torchrl.envs.transforms import Transform

from ship_trl.learn.algorithm import add_prefix, strip_prefix
from ship_trl.learn.masks import ACTION_MASK, mask_of
from ship_trl.learn.q_learning import STEPS, sum_rewards

STATES: tuple[NestedKey, ...] = ("state", ("next", "state"))
# How many rows later the same environment's next transition is stored.
STRIDE = "stride"
# Number of steps that are collected before they are written to the storage.
MAX_PENDING = 256


class DrawStates(Transform):
    """Adds what a network observes to a batch, under `key`: `draw` maps states [..., S] to its input."""

    def __init__(self, draw: Callable[[Tensor], Tensor], key: str = "pixels") -> None:
        super().__init__(in_keys=[*STATES], out_keys=[key, ("next", key)])
        self.draw = draw

    def _apply_transform(self, obs: Tensor) -> Tensor:
        return self.draw(obs)


class TransitionStorage(Storage):
    """Storage with one tensor per key, which needs a third of `LazyTensorStorage`'s time.

    Writes and reads are small: tensordicts would take most of the time. `get` omits the `hidden` keys. With
    `n` above 1, `reward` is the discounted sum of up to `n` steps, `next` is what follows the last of them,
    and `steps_to_next_obs` [B, 1] counts them: all is computed when a batch is read.

    Attributes:
        newest: row of the last transition.
    """

    def __init__(
        self,
        capacity: int,
        device: torch.device,
        hidden: frozenset[NestedKey] = frozenset(),
        n: int = 1,
        gamma: float = 1.0,
    ) -> None:
        super().__init__(capacity)
        self.device, self.hidden, self._n, self._gamma = device, hidden, n, gamma
        self._rows: dict[NestedKey, Tensor] = {}
        self._len = self.newest = 0

    def __len__(self) -> int:
        return self._len

    def set(self, cursor: Any, data: TensorDictBase, *, set_cursor: bool = True) -> None:
        """Write transitions [K] to the rows `cursor` [K], or one transition to one row.

        The first write defines the keys.
        """
        if not self._rows:
            for key, value in data.items(True, True):
                shape = (self.max_size, *value.shape[data.batch_dims :])
                self._rows[key] = value.new_zeros(shape, device=self.device)
        # Neighbouring rows as a slice, because a tensor of their numbers would be copied to a GPU.
        is_contiguous = isinstance(cursor, Tensor) and cursor.dim() == 1 and bool((cursor.diff() == 1).all())
        where = slice(int(cursor[0]), int(cursor[-1]) + 1) if is_contiguous and len(cursor) else cursor
        for key, rows in self._rows.items():
            rows[where] = data.get(key)
        if set_cursor:
            self._set_last_cursor(cursor)
            written = cursor.tolist() if isinstance(cursor, Tensor) and cursor.dim() else [int(cursor)]
            self._len, self.newest = max(self._len, 1 + max(written)), written[-1]
        self._bump_mutation_revision()

    def get(self, index: Any) -> TensorDict:
        """Read the rows `index` [B] as a tensordict [B]."""
        if self._n > 1:
            return self._get_n_step(torch.arange(self._len, device=self.device)[index])
        shown = {k: rows[: self._len][index] for k, rows in self._rows.items() if k not in self.hidden}
        return make_batch(shown, self.device)

    def _get_n_step(self, index: Tensor) -> TensorDict:
        """Read the rows `index` [B] with what follows the last of their steps."""

        def read(row: Tensor) -> tuple[Tensor, Tensor]:
            return self._rows["next", "reward"][row, 0], self._rows["next", "done"][row, 0]

        def follow(row: Tensor) -> tuple[Tensor, Tensor]:
            stride = self._rows[STRIDE][row]
            return (row + stride) % self.max_size, (self.newest - row) % self.max_size >= stride

        reward, last, count = sum_rewards(self._n, self._gamma, index, read, follow)
        shown: dict[NestedKey, Tensor] = {
            key: values[index if isinstance(key, str) else last]
            for key, values in self._rows.items()
            if key not in self.hidden and key != STRIDE
        }
        summed: dict[NestedKey, Tensor] = {("next", "reward"): reward[:, None], STEPS: count[:, None]}
        return make_batch(shown | summed, self.device)

    def write(self, key: NestedKey, number: int, value: Tensor) -> Tensor:
        """Write row `number` of a key, and return the stored row."""
        if key not in self._rows:
            self._rows[key] = value.new_zeros((self.max_size, *value.shape), device=self.device)
        self._rows[key][number] = value
        return self._rows[key][number]

    def state_dict(self) -> dict[str, Any]:
        """Return the stored tensors [L, ...] by dotted keys, also hidden ones, without copying them."""
        return {join_key(key): rows[: self._len] for key, rows in self._rows.items()}

    def load_state_dict(self, state_dict: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned; `write` may add further keys with the same number of rows."""
        self._rows, self._len = {}, 0
        for name, value in state_dict.items():
            self._len, key = len(value), unravel_key(tuple(name.split(".")))
            self._rows[key] = value.new_zeros((self.max_size, *value.shape[1:]), device=self.device)
            self._rows[key][: self._len] = value

    def dumps(self, path: Any) -> None:
        """Raise an error: TorchRL would write a replay without its transitions."""
        raise NotImplementedError("not supported; save state_dict() instead")

    def _empty(self) -> None:
        self._len = 0


def join_key(key: NestedKey) -> str:
    """Join a nested key with dots."""
    return key if isinstance(key, str) else ".".join(key)


def make_batch(entries: dict[NestedKey, Tensor], device: torch.device | None = None) -> TensorDict:
    """Make a tensordict [B] of tensors [B, ...]; keys with two parts go into its `next`."""
    outer: dict[str, Any] = {key: value for key, value in entries.items() if isinstance(key, str)}
    following = {key[1]: value for key, value in entries.items() if isinstance(key, tuple)}
    size = outer["action"].shape
    outer["next"] = TensorDict(following, batch_size=size, device=device)
    return TensorDict(outer, batch_size=size, device=device)


class StateReplay(TensorDictReplayBuffer):
    """Uniform replay of `capacity` transitions: a `TensorDictReplayBuffer` with TorchRL's keys.

    A batch [B] has the observation [B, ...] and `action` [B]. Its `next` has the observation, and `reward`
    (scaled), `done` and `terminated` [B, 1], and `action_mask` [B, A] if the environment writes one. Batches
    are drawn uniformly, with replacement.

    Args:
        capacity: maximum number of transitions; new ones then overwrite the oldest.
        reward_scale: factor of the rewards.
        generator: draws the batches.
        device: device of the stored transitions.
        observation: the key that is stored: `state`, or `features` where layers are frozen.
        transform: applied to batches, for example `DrawStates`.
        batch_size: default of `sample()` and of iteration.
        encode: maps states [N, S] to the observation [N, ...]. The replay then stores both, but a checkpoint
            only the states: observations are a hundred times larger.
        n: rewards before a target bootstraps.
        gamma: discount per step of these rewards.
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
        n: int = 1,
        gamma: float = 1.0,
    ) -> None:
        # Writing one step costs as much as writing many, so steps are collected until a batch is drawn.
        self._pending: list[dict[NestedKey, Tensor]] = []
        self.reward_scale, self.observation = reward_scale, observation
        self.generator, self._encode, self._n = generator, encode, n
        # The keys that can be recomputed, each with the key of the states to compute it from.
        self._computed: dict[NestedKey, NestedKey] = {}
        if encode is not None:
            self._computed = {observation: STATES[0], ("next", observation): STATES[1]}
        hidden = frozenset(self._computed.values())
        storage, writer = TransitionStorage(capacity, device, hidden, n, gamma), RoundRobinWriter()
        super().__init__(
            storage=storage,
            writer=writer,
            # The storage returns whole batches.
            collate_fn=lambda batch: batch,
            generator=generator,
            transform=transform,
            batch_size=batch_size,
        )

    def __len__(self) -> int:
        self._store()
        return super().__len__()

    def extend(self, tensordicts: TensorDictBase, **_: object) -> None:
        """Store a step of N environments: tensordict [N] with the observation, `action` and `next`.

        Copies are kept, because the caller may reuse its memory.
        """
        step, following = tensordicts, tensordicts.get("next")
        count = step.batch_size[0]
        strides = {STRIDE: torch.full((count,), count, device=step.device)} if self._n > 1 else {}
        allowed = mask_of(following)
        masks: dict[NestedKey, Tensor] = {} if allowed is None else {("next", ACTION_MASK): allowed.clone()}
        self._pending.append(
            strides
            | masks
            | {key: step.get(key).clone() for key in self._computed.values()}
            | {
                self.observation: step.get(self.observation).clone(),
                "action": step.get("action").clone(),
                ("next", self.observation): following.get(self.observation).clone(),
                ("next", "reward"): following.get("reward") * self.reward_scale,
                ("next", "done"): following.get("done").clone(),
                ("next", "terminated"): following.get("terminated").clone(),
            }
        )
        if len(self._pending) == MAX_PENDING:
            self._store()

    def add(self, data: TensorDictBase) -> None:
        """Store one step of one environment."""
        self.extend(data.unsqueeze(0))

    def empty(self, *args: Any, **kwargs: Any) -> None:
        """Delete all transitions."""
        self._pending.clear()
        super().empty(*args, **kwargs)

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to resume with the same transitions and draws, by dotted names.

        Leave out observations that can be recomputed. Tensors are not copied.
        """
        self._store()
        writer, computed = self._writer.state_dict(), set(map(join_key, self._computed))
        rows = self._storage.state_dict()
        return {
            **add_prefix("rows", {key: value for key, value in rows.items() if key not in computed}),
            "cursor": torch.tensor([writer["_cursor"], writer["_write_count"]]),
            "generator": self.generator.get_state(),
        }

    def load_state_dict(self, state_dict: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned, and recompute the observations that it left out.

        Raises:
            ValueError: the state is of another capacity, or its rows do not fit.
        """
        rows = strip_prefix("rows", state_dict)
        cursor, count = state_dict["cursor"].tolist()
        wanted, found = min(count, self._storage.max_size), {len(value) for value in rows.values()}
        if found - {wanted}:
            raise ValueError(
                f"the state of a replay has {max(found)} rows; allowed: {wanted}, of the same capacity"
            )
        self._pending.clear()
        self._storage.load_state_dict(rows)
        if rows:
            self._recompute(rows)
        self._writer.load_state_dict({"_cursor": cursor, "_write_count": count})
        self._storage.newest = (cursor - 1) % self._storage.max_size
        self.generator.set_state(state_dict["generator"].cpu())

    def _recompute(self, rows: Mapping[str, Tensor]) -> None:
        """Recompute observations from the stored states, directly into the storage."""
        # The state after a step is usually also the state before the next one: encode it only once.
        encoded: dict[bytes, Tensor] = {}
        for key, source in self._computed.items():
            assert self._encode is not None
            for number, state in enumerate(rows[join_key(source)].split(1)):
                bits = state.cpu().numpy().tobytes()
                observation = encoded[bits] if bits in encoded else self._encode(state)[0]
                encoded[bits] = self._storage.write(key, number, observation)

    def __getitem__(self, index: Any) -> Any:
        self._store()
        return super().__getitem__(index)

    def _store(self) -> None:
        if self._pending:
            steps = {key: torch.cat([step[key] for step in self._pending]) for key in self._pending[0]}
            self._pending.clear()
            # Not `super()`: a `TensorDictReplayBuffer` adds an index to each transition.
            ReplayBuffer.extend(self, make_batch(steps))

    def sample(self, batch_size: int | None = None, return_info: bool = False) -> TensorDictBase:
        """Draw a batch of transitions."""
        self._store()
        # Not `super()`: a `TensorDictReplayBuffer` adds an index, which uniform replay does not need.
        batch: TensorDictBase = ReplayBuffer.sample(self, batch_size, return_info)
        return batch
