"""Roll out any policy. Steps are deterministic, so one episode of a greedy policy from a start is exact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase

# Steps for which memory is taken at first.
STEPS = 64
# What an episode is made of. Pictures are left out: those of 4,000 episodes take 10 GB.
KEPT: tuple[NestedKey, ...] = (
    *("state", "action", "action_value"),
    *(("next", key) for key in ("state", "reward", "done", "goal", "collision", "dcpa")),
)
# Reads a tensordict with `state` and writes `action`, as every policy module of TorchRL does.
Policy = Callable[[TensorDictBase], TensorDictBase]


@dataclass(frozen=True)
class Episode:
    """An episode of T steps and how it ended.

    Shapes: states float [T + 1, S], actions int64 [T], raw rewards float [T]; q_values float [T, A], or None
    if the policy wrote no `action_value`. `dcpa` is the least distance to any target ship in metres, infinite
    without target ships.
    """

    states: Tensor
    actions: Tensor
    q_values: Tensor | None
    rewards: Tensor
    goal: bool
    collision: bool
    dcpa: float

    @property
    def episode_return(self) -> float:
        """Undiscounted sum of raw rewards."""
        return float(self.rewards.sum(dtype=torch.float64))

    @property
    def length(self) -> int:
        """Number of steps."""
        return len(self.actions)

    @property
    def outcome(self) -> str:
        """How the episode ended: goal, collision or timeout."""
        return outcome(self.goal, self.collision)


def mean_return(episodes: Sequence[Episode]) -> float:
    """Return the mean return of episodes."""
    return sum(one.episode_return for one in episodes) / len(episodes)


def outcome(goal: bool, collision: bool) -> str:
    """Name the end of an episode: goal, collision or timeout."""
    return "goal" if goal else "collision" if collision else "timeout"


@torch.no_grad()
def rollout(env: EnvBase, policy: Policy) -> list[Episode]:
    """Roll out one episode in each of the N environments of a batch.

    The environment needs the keys `state`, `action`, `goal`, `collision` and `dcpa`. TorchRL's own `rollout`
    either stops when the first episode of a batch ends, or continues with new episodes.
    """
    current, kept, count = env.reset(), dict[NestedKey, Tensor](), 0
    running = torch.ones(env.batch_size, dtype=torch.bool, device=env.device)
    lengths = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)
    while bool(running.any()):
        stepped, current = env.step_and_maybe_reset(policy(current))
        keep(kept, count, stepped)
        count += 1
        lengths += running
        running &= ~stepped["next", "done"].squeeze(-1)
    # At once: each copy from a GPU waits for all earlier operations.
    kept = {key: value[:count].cpu() for key, value in kept.items()}
    return [extract_episode(kept, row, length) for row, length in enumerate(lengths.tolist())]


def keep(kept: dict[NestedKey, Tensor], count: int, step: TensorDictBase) -> None:
    """Copy the step after `count` others into tensors [T, N, ...], which double when they are full.

    Small tensors allocated between the pictures of each step would keep the memory of all of them.
    """
    for key in KEPT:
        value = step.get(key, None)
        if value is None:
            continue
        if key not in kept:
            kept[key] = value.new_empty((STEPS, *value.shape))
        elif count == len(kept[key]):
            kept[key] = torch.cat((kept[key], torch.empty_like(kept[key])))
        kept[key][count] = value


def extract_episode(kept: dict[NestedKey, Tensor], row: int, length: int) -> Episode:
    """Extract the first episode of one environment, of `length` steps."""

    def steps(key: NestedKey) -> Tensor:
        return kept[key][:length, row].clone()

    def last(key: str) -> Tensor:
        return kept["next", key][length - 1, row]

    return Episode(
        states=torch.cat((steps("state"), last("state")[None])),
        actions=steps("action"),
        rewards=steps(("next", "reward")).squeeze(-1),
        q_values=steps("action_value") if "action_value" in kept else None,
        goal=bool(last("goal")),
        collision=bool(last("collision")),
        dcpa=float(last("dcpa")),
    )
