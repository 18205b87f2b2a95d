"""What measures of similarity ask of a case: its network, the states that a planner meets, and episodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode, greedy_policy, rollout
from ship_trl.policies.named import load_network, load_policy
from ship_trl.policies.reference import best_known, score_bounds
from ship_trl.sim.cases import Case, Suite, suite_of

# Episodes of the planner, and the share of random actions in them.
EPISODES, EXPLORATION = 32, 0.3


@dataclass(frozen=True)
class Probe:
    """Transitions of a case: states and next states [N, S], actions [N], rewards [N], terminated [N].

    `planned` [N] are the planner's actions in the states, which a part of the actions are.
    """

    states: Tensor
    planned: Tensor
    actions: Tensor
    rewards: Tensor
    next_states: Tensor
    terminated: Tensor


class Known:
    """A case, and a network that was trained on it or None; what measures ask is computed once."""

    def __init__(self, case: Case, world: World, network: DuelingNetwork | None = None) -> None:
        self.case, self.world, self._network = case, world, network
        self.env = make_env(suite_of(case), world)

    @classmethod
    def load(cls, case: Case, world: World, path: Path) -> Known:
        """Read the network from a safetensors file.

        Raises:
            ConfigError: the file holds no network for this world.
        """
        return cls(case, world, load_network(path, make_env(suite_of(case), world), "source_file"))

    @property
    def network(self) -> DuelingNetwork:
        """The network, in evaluation.

        Raises:
            ValueError: there is none.
        """
        if self._network is None:
            raise ValueError(f"case {self.case.name} has no network")
        return self._network

    def observer(self, network: DuelingNetwork) -> Callable[[Tensor], Tensor]:
        """Return what maps states of the case to a network's input."""
        return self.env.observer(network.config, network.colour)

    def observe(self, network: DuelingNetwork) -> Tensor:
        """Return what a network sees in the probe's states, [N, ...]."""
        return self.observer(network)(self.probe.states)

    @cached_property
    def probe(self) -> Probe:
        """The planner's transitions."""
        return probe(suite_of(self.case), self.world)

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """The mean return of random actions, and the best known return."""
        return score_bounds(self.case, self.world)

    @cached_property
    def own_episode(self) -> Episode:
        """The greedy episode of the network that was trained on the case."""
        (episode,) = rollout(self.env, greedy_policy(self.network, self.observer(self.network)))
        return episode

    @cached_property
    def planned_episode(self) -> Episode:
        """The episode of the best known plan."""
        actions = iter(best_known(self.case, self.world).actions)

        def follow(step: TensorDictBase) -> TensorDictBase:
            return step.set("action", torch.tensor([next(actions)]))

        (episode,) = rollout(self.env, follow)
        return episode


def probe(suite: Suite, world: World, episodes: int = EPISODES, seed: int = 0) -> Probe:
    """Run the planner (velocity obstacles) in a case, with random actions among its own."""
    env = make_env(suite, world, episodes)
    generator, planner = Generator().manual_seed(seed), load_policy("vo", env)
    planned: list[Tensor] = []

    def explore(step: TensorDictBase) -> TensorDictBase:
        best = planner(step).get("action").clone()
        planned.append(best)
        drawn = torch.randint(len(world.actions), best.shape, generator=generator)
        is_random = torch.rand(len(best), generator=generator) < EXPLORATION
        return step.set("action", torch.where(is_random, drawn, best))

    found = rollout(env, explore)
    chosen = torch.stack(planned)
    terminated = [torch.zeros(one.length, dtype=torch.bool) for one in found]
    for ends, one in zip(terminated, found, strict=True):
        ends[-1] = one.goal or one.collision
    return Probe(
        states=torch.cat([one.states[:-1] for one in found]),
        planned=torch.cat([chosen[: one.length, row] for row, one in enumerate(found)]),
        actions=torch.cat([one.actions for one in found]),
        rewards=torch.cat([one.rewards for one in found]),
        next_states=torch.cat([one.states[1:] for one in found]),
        terminated=torch.cat(terminated),
    )
