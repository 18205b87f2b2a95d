"""All measures of similarity that are judged: those of cases, those that ask the source, and oracles.

Oracles ask the network of the target too: they explain gains, and do not predict them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor

from ship_trl.config.types import World
from ship_trl.explain.encoding import cka, gram
from ship_trl.fast.worlds import make_env
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode, greedy_policy, rollout
from ship_trl.policies import reference as of_networks
from ship_trl.policies.named import load_policy
from ship_trl.sim.cases import Case, suite_of
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import wrap_angle
from ship_trl.sim.state import HEADING, position
from ship_trl.transfer import similarity as of_cases
from ship_trl.transfer.similarity import Measure
from studies.sources.judge import ORACLE
from studies.sources.logme import logme

# Episodes of the planner, and the share of random actions in them.
EPISODES, EXPLORATION = 32, 0.3
# Side of a cell in metres, and headings of a circle.
CELL, HEADINGS = 50.0, 8
# For the gradients' loss, as in profile quick.
GAMMA, REWARD_SCALE = 0.95, 0.1


@dataclass(frozen=True)
class Known:
    """A case, and a network that was trained on it; what measures ask is computed once."""

    case: Case
    world: World
    network: DuelingNetwork

    @cached_property
    def env(self) -> ShipEnv:
        """The case alone."""
        return make_env(suite_of(self.case), self.world)

    def observe(self, network: DuelingNetwork, states: str = "state") -> Tensor:
        """Return what a network sees in the probe's states, or in those that follow, [N, ...]."""
        return self.env.observer(network.config, network.colour)(self.probe[states])

    @cached_property
    def probe(self) -> TensorDict:
        """Transitions of the planner (velocity obstacles), with random actions among its own, [N].

        Keys: `state` and `next_state` [N, S], `action`, `reward`, `terminated`, and `planned`, the planner's
        action in the state.
        """
        env = make_env(suite_of(self.case), self.world, EPISODES)
        generator, planner = Generator().manual_seed(0), load_policy("vo", env)
        chosen: list[Tensor] = []

        def explore(step: TensorDictBase) -> TensorDictBase:
            best = planner(step).get("action").clone()
            chosen.append(best)
            drawn = torch.randint(len(self.world.actions), best.shape, generator=generator)
            is_random = torch.rand(len(best), generator=generator) < EXPLORATION
            return step.set("action", torch.where(is_random, drawn, best))

        found = rollout(env, explore)
        planned = torch.stack(chosen)
        parts = []
        for row, one in enumerate(found):
            is_last = torch.arange(one.length) == one.length - 1
            values = {"state": one.states[:-1], "next_state": one.states[1:]}
            values |= {"action": one.actions, "reward": one.rewards, "planned": planned[: one.length, row]}
            values["terminated"] = is_last & (one.goal or one.collision)
            parts.append(TensorDict(values, [one.length]))
        return TensorDict.cat(parts)

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """The mean return of random actions, and the best known return."""
        return of_networks.score_bounds(self.case, self.world)

    @cached_property
    def own_episode(self) -> Episode:
        """The greedy episode of the network."""
        see = self.env.observer(self.network.config, self.network.colour)
        (episode,) = rollout(self.env, greedy_policy(self.network, see))
        return episode

    @cached_property
    def planned_episode(self) -> Episode:
        """The episode of the best known plan."""
        (episode,) = rollout(self.env, of_networks.follow_best_known(self.env))
        return episode


def from_cases(measure: Measure) -> Measure:
    """Make a measure of two cases one of what is known of them."""

    def value(source: Known, target: Known) -> float:
        return measure.value(source.case, target.case, target.world)

    return Measure(value, measure.nearer)


def zero_shot(source: Known, target: Known) -> float:
    """Return the score that the source's network reaches in the target before it is trained there."""
    return of_networks.zero_shot(source.network, target.case, target.world, target.bounds)


def visits(source: Known, target: Known) -> float:
    """Return the overlap of where the source's network goes at home and the best known plan in the target.

    It is the sum of the smaller shares of steps in each cell, 0 to 1: `CELL` metres wide, counted from the
    start, with an eighth of the headings.
    """
    one, other = cells(source.own_episode), cells(target.planned_episode)
    return sum(min(count / one.total(), other[cell] / other.total()) for cell, count in one.items())


def cells(episode: Episode) -> Counter[tuple[int, ...]]:
    """Return how many of an episode's steps are in each cell."""
    states = episode.states[:-1]
    place = torch.div(position(states) - position(states[:1]), CELL, rounding_mode="floor")
    turn = torch.div(wrap_angle(states[:, HEADING]) * HEADINGS, 2 * torch.pi).round() % HEADINGS
    return Counter(map(tuple, torch.cat((place, turn[:, None]), 1).int().tolist()))


@torch.no_grad()
def q_values(one: Known, at: Known) -> Tensor:
    """Return the Q-values of a network in the states of a case, [N, A]."""
    found: Tensor = one.network(at.observe(one.network))
    return found


def agreement(source: Known, target: Known) -> float:
    """Return the share of the target's states in which the source's network does what the planner does."""
    return float((q_values(source, target).argmax(-1) == target.probe["planned"]).float().mean())


@torch.no_grad()
def last_features(one: Known, at: Known) -> Tensor:
    """Return a network's last hidden features in the states of a case, [N, H]."""
    return one.network.activations(at.observe(one.network))["shared"].float()


def logme_of_actions(source: Known, target: Known) -> float:
    """Return LogME of the source's last features for the planner's actions in the target."""
    return logme(last_features(source, target).double().numpy(), target.probe["planned"].numpy())


def gradient_of(network: DuelingNetwork, at: Known) -> Tensor:
    """Return the gradient of half the squared TD error on the transitions of a case, all weights in a row."""
    with torch.no_grad():
        following = network(at.observe(network, "next_state")).amax(-1)
        td_target = REWARD_SCALE * at.probe["reward"] + GAMMA * following * ~at.probe["terminated"]
    q = network(at.observe(network)).gather(-1, at.probe["action"][:, None]).squeeze(-1)
    loss = 0.5 * (td_target - q).square().mean()
    return torch.cat([part.flatten() for part in torch.autograd.grad(loss, list(network.parameters()))])


def gradient(source: Known, target: Known) -> float:
    """Return the cosine of the gradients of the source's network in both cases."""
    network = source.network.requires_grad_(True)
    pair = gradient_of(network, source), gradient_of(network, target)
    return float(torch.nn.functional.cosine_similarity(*pair, dim=0))


def cka_of_features(source: Known, target: Known) -> float:
    """Return CKA of the last features of both networks in the target's states."""
    return cka(*(gram(last_features(known, target)) for known in (source, target)))


def q_distance(source: Known, target: Known) -> float:
    """Return the mean distance of the Q-values, in scaled rewards (Carroll and Seppi, 2005)."""
    return float((q_values(source, target) - q_values(target, target)).abs().mean())


def policy_agreement(source: Known, target: Known) -> float:
    """Return the share of the target's states where both networks do the same (Carroll and Seppi, 2005)."""
    first, second = (q_values(known, target).argmax(-1) for known in (source, target))
    return float((first == second).double().mean())


ORACLES = {
    "cka": Measure(cka_of_features),
    "q_distance": Measure(q_distance, nearer=True),
    "policy_agreement": Measure(policy_agreement),
}
# Those that the kept tables have: a measure that is added to the package later is not among them.
OF_CASES = ("similarity", "distance", "side", "ships")
# In the order of the tables that are kept.
MEASURES = {
    **{name: from_cases(of_cases.MEASURES[name]) for name in OF_CASES},
    "visits": Measure(visits),
    "zero_shot": Measure(zero_shot),
    "agreement": Measure(agreement),
    "logme": Measure(logme_of_actions),
    "gradient": Measure(gradient),
    **ORACLES,
}
# What each must know.
KINDS = {
    **dict.fromkeys(MEASURES, "source"),
    **dict.fromkeys(OF_CASES, "cases"),
    **dict.fromkeys(ORACLES, ORACLE),
}
