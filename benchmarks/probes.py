"""The states that a planner meets in a case, and episodes there, for measures of similarity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor

from ship_trl.config.types import World
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode, rollout
from ship_trl.policies.reference import best_known
from ship_trl.policies.vo import vo
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.suites import Suite
from ship_trl.sources.measures import Known

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


class Probed(Known):
    """A case and its network, with what the measures of the benchmark ask for; each is computed once."""

    @cached_property
    def probe(self) -> Probe:
        """The planner's transitions."""
        return probe(self.suite, self.world)

    def observe(self, network: DuelingNetwork) -> Tensor:
        """Return what a network sees in the probe's states, [N, ...]."""
        return self.observer(network)(self.probe.states)

    @cached_property
    def own_episode(self) -> Episode:
        """The greedy episode of the network that was trained on the case."""
        return self.greedy_episode(self.network)

    @cached_property
    def planned_episode(self) -> Episode:
        """The episode of the best known plan."""
        actions = iter(best_known(self.case, self.world).actions)

        def follow(step: TensorDictBase) -> TensorDictBase:
            return step.set("action", torch.tensor([next(actions)]))

        (episode,) = rollout(ShipEnv(self.suite, self.world), follow)
        return episode


def probe(suite: Suite, world: World, episodes: int = EPISODES, seed: int = 0) -> Probe:
    """Run the planner (velocity obstacles) in a case, with random actions among its own."""
    env = ShipEnv(suite, world, episodes)
    generator, planner = Generator().manual_seed(seed), vo(env)
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
