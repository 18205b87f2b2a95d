"""Roll out any policy. Steps are deterministic, so one episode of a greedy policy from a start is exact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase

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


def outcome(goal: bool, collision: bool) -> str:
    """Name the end of an episode: goal, collision or timeout."""
    return "goal" if goal else "collision" if collision else "timeout"


@torch.no_grad()
def rollout(env: EnvBase, policy: Policy) -> list[Episode]:
    """Roll out one episode in each of the N environments of a batch.

    The environment needs the keys `state`, `action`, `goal`, `collision` and `dcpa`. TorchRL's own `rollout`
    either stops when the first episode of a batch ends, or continues with new episodes.
    """
    current = env.reset()
    steps = []
    running = torch.ones(env.batch_size, dtype=torch.bool, device=env.device)
    while bool(running.any()):
        stepped, current = env.step_and_maybe_reset(policy(current))
        steps.append(stepped)
        running &= ~stepped["next", "done"].squeeze(-1)
    done = torch.stack([step["next", "done"].squeeze(-1) for step in steps])
    lengths = (done.to(torch.int8).argmax(0) + 1).tolist()
    return [extract_episode(steps[:length], row) for row, length in enumerate(lengths)]


def extract_episode(steps: list[TensorDictBase], row: int) -> Episode:
    """Extract the episode of one environment from the steps of a batch."""

    def stack(key: str) -> Tensor:
        return torch.stack([step[key][row] for step in steps]).cpu()

    last = steps[-1]["next"]
    return Episode(
        states=torch.cat((stack("state"), last["state"][row : row + 1].cpu())),
        actions=stack("action"),
        rewards=torch.stack([step["next", "reward"][row, 0] for step in steps]).cpu(),
        q_values=stack("action_value") if "action_value" in steps[0] else None,
        goal=bool(last["goal"][row, 0]),
        collision=bool(last["collision"][row, 0]),
        dcpa=float(last["dcpa"][row, 0]),
    )
