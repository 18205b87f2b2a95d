"""The best episode from each start so far, which a learner may imitate.

After self-imitation learning (Oh et al., 2018). That keeps all steps and imitates those whose return is above
their value; this keeps one whole episode for each start: steps are deterministic here, so the same actions
from the same start give the same return again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch import Tensor


@dataclass(frozen=True)
class Best:
    """States [T, S] and actions [T] of an episode, and the undiscounted sum of its rewards."""

    states: Tensor
    actions: Tensor
    episode_return: float


class BestEpisodes:
    """Cuts episodes out of the steps of a batched environment, and keeps the best from each start.

    Starts must come again: each new one adds an episode to what is kept.
    """

    def __init__(self) -> None:
        self._best: dict[tuple[float, ...], Best] = {}
        # Whose turn it is in `take`.
        self._turn = 0
        # Steps [N] since the oldest running episode began; length and return of each row's episode so far.
        self._states: list[Tensor] = []
        self._actions: list[Tensor] = []
        self._lengths: list[int] = []
        self._returns: list[float] = []

    def __len__(self) -> int:
        return len(self._best)

    def observe(self, step: TensorDictBase) -> None:
        """Take note of a step [N] with `state`, `action`, and below `next` `reward` and `done`."""
        rewards, done = (step["next", key].squeeze(-1).tolist() for key in ("reward", "done"))
        count = len(rewards)
        self._states.append(step["state"].clone())
        self._actions.append(step["action"].clone())
        self._lengths = [length + 1 for length in self._lengths or [0] * count]
        self._returns = [a + b for a, b in zip(self._returns or [0.0] * count, rewards, strict=True)]
        for row in range(count):
            if done[row]:
                self._end(row)
        oldest = max(self._lengths)
        del self._states[: len(self._states) - oldest], self._actions[: len(self._actions) - oldest]

    def _end(self, row: int) -> None:
        """Keep the episode of a row if it is the best from its start, and begin another."""
        length, episode_return = self._lengths[row], self._returns[row]
        self._lengths[row], self._returns[row] = 0, 0.0
        start = tuple(self._states[-length][row].tolist())
        if start not in self._best or episode_return > self._best[start].episode_return:
            states, actions = (
                torch.stack([step[row] for step in steps[-length:]])
                for steps in (self._states, self._actions)
            )
            self._best[start] = Best(states, actions, episode_return)

    def take(self) -> Best:
        """Return the best episode from one of the starts, each in turn."""
        best = list(self._best.values())[self._turn % len(self._best)]
        self._turn += 1
        return best

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs."""
        best = list(self._best.values())
        tensors = {
            "lengths": self._lengths,
            "best_lengths": [len(one.actions) for one in best],
            "turn": self._turn,
        }
        state = {name: torch.tensor(value, dtype=torch.int64) for name, value in tensors.items()}
        returns = {"returns": self._returns, "best_returns": [one.episode_return for one in best]}
        state |= {name: torch.tensor(value, dtype=torch.float64) for name, value in returns.items()}
        if self._states:
            state |= {"states": torch.stack(self._states), "actions": torch.stack(self._actions)}
        if best:
            state["best_states"] = torch.cat([one.states for one in best])
            state["best_actions"] = torch.cat([one.actions for one in best])
        return state

    def load_state_dict(self, state: Mapping[str, Tensor], device: torch.device) -> None:
        """Load what `state_dict` returned."""
        self._lengths, self._returns = state["lengths"].tolist(), state["returns"].tolist()
        self._turn = int(state["turn"])
        self._states, self._actions = (
            list(state[key].to(device)) if key in state else [] for key in ("states", "actions")
        )
        self._best = {}
        if "best_states" in state:
            lengths = state["best_lengths"].tolist()
            parts = (state[key].to(device).split(lengths) for key in ("best_states", "best_actions"))
            for states, actions, value in zip(*parts, state["best_returns"].tolist(), strict=True):
                self._best[tuple(states[0].tolist())] = Best(states, actions, value)
