"""All measures of similarity that are judged: those of cases, those that ask the source, and oracles.

Oracles ask the network of the target too: they explain gains, and do not predict them.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import torch
from torch import Tensor

from ship_trl.explain.encoding import cka, gram
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode
from ship_trl.policies import reference as of_networks
from ship_trl.sim.geometry import wrap_angle
from ship_trl.sim.state import HEADING, position
from ship_trl.transfer import similarity as of_cases
from ship_trl.transfer.similarity import Measure
from studies.sources.judge import ORACLE
from studies.sources.known import Known
from studies.sources.logme import logme

# Side of a cell in metres, and headings of a circle.
CELL, HEADINGS = 50.0, 8
# For the gradients' loss, as in profile quick.
GAMMA, REWARD_SCALE = 0.95, 0.1


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
    return sum(min(share, other[cell]) for cell, share in one.items())


def cells(episode: Episode) -> Counter[tuple[int, ...]]:
    """Return the share of an episode's steps in each cell."""
    states = episode.states[:-1]
    place = torch.div(position(states) - position(states[:1]), CELL, rounding_mode="floor")
    turn = torch.div(wrap_angle(states[:, HEADING]) * HEADINGS, 2 * torch.pi).round() % HEADINGS
    rows = torch.cat((place, turn[:, None]), 1).int().tolist()
    found: Counter[tuple[int, ...]] = Counter()
    for row in rows:
        found[tuple(row)] += 1 / len(rows)  # type: ignore[assignment]
    return found


@torch.no_grad()
def agreement(source: Known, target: Known) -> float:
    """Return the share of the target's states in which the source's network does what the planner does."""
    chosen = source.network(target.observe(source.network)).argmax(-1)
    return float((chosen == target.probe.planned).float().mean())


@torch.no_grad()
def last_features(network: DuelingNetwork, at: Known) -> Tensor:
    """Return a network's last hidden features in the states of a case, [N, H]."""
    return network.activations(at.observe(network))["shared"].float()


def logme_of_actions(source: Known, target: Known) -> float:
    """Return LogME of the source's last features for the planner's actions in the target."""
    features = last_features(source.network, target).double().numpy()
    return logme(features, target.probe.planned.numpy())


def gradient_of(network: DuelingNetwork, at: Known) -> Tensor:
    """Return the gradient of half the squared TD error on the transitions of a case, all weights in a row."""
    probe, see = at.probe, at.observer(network)
    with torch.no_grad():
        following = network(see(probe.next_states)).amax(-1)
        td_target = REWARD_SCALE * probe.rewards + GAMMA * following * ~probe.terminated
    q = network(see(probe.states)).gather(-1, probe.actions[:, None]).squeeze(-1)
    loss = 0.5 * (td_target - q).square().mean()
    return torch.cat([part.flatten() for part in torch.autograd.grad(loss, list(network.parameters()))])


def gradient(source: Known, target: Known) -> float:
    """Return the cosine of the gradients of the source's network in both cases."""
    network = source.network.requires_grad_(True)
    pair = gradient_of(network, source), gradient_of(network, target)
    return float(torch.nn.functional.cosine_similarity(*pair, dim=0))


def cka_of_features(source: Known, target: Known) -> float:
    """Return CKA of the last features of both networks in the target's states."""
    return cka(*(gram(last_features(known.network, target)) for known in (source, target)))


@torch.no_grad()
def q_pair(source: Known, target: Known) -> tuple[Tensor, Tensor]:
    """Return the Q-values of both networks in the target's states, [N, A] each."""
    first, second = (known.network(target.observe(known.network)) for known in (source, target))
    return first, second


def q_distance(source: Known, target: Known) -> float:
    """Return the mean distance of the Q-values, in scaled rewards (Carroll and Seppi, 2005)."""
    first, second = q_pair(source, target)
    return float((first - second).abs().mean())


def policy_agreement(source: Known, target: Known) -> float:
    """Return the share of the target's states where both networks do the same (Carroll and Seppi, 2005)."""
    first, second = q_pair(source, target)
    return float(np.mean((first.argmax(-1) == second.argmax(-1)).numpy()))


ORACLES = {
    "cka": Measure(cka_of_features),
    "q_distance": Measure(q_distance, nearer=True),
    "policy_agreement": Measure(policy_agreement),
}
# In the order of the tables that are kept.
MEASURES = {
    **{name: from_cases(measure) for name, measure in of_cases.MEASURES.items()},
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
    **dict.fromkeys(of_cases.MEASURES, "cases"),
    **dict.fromkeys(ORACLES, ORACLE),
}
