"""Measures of similarity by name: of two cases, and of the source's network."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode
from ship_trl.sim.geometry import wrap_angle
from ship_trl.sim.state import HEADING, position
from ship_trl.sources.known import Known
from ship_trl.sources.logme import logme
from ship_trl.transfer import similarity as of_cases

# Side of a cell in metres, and headings of a circle.
CELL, HEADINGS = 50.0, 8
# For the gradients' loss, as in profile quick.
GAMMA, REWARD_SCALE = 0.95, 0.1


@dataclass(frozen=True)
class Measure:
    """A measure of source and target; if `nearer`, smaller values mean more similar."""

    value: Callable[[Known, Known], float]
    nearer: bool = False


def from_cases(measure: of_cases.Measure) -> Measure:
    """Make a measure of two cases one of what is known of them."""

    def value(source: Known, target: Known) -> float:
        return measure.value(source.case, target.case, target.world)

    return Measure(value, measure.nearer)


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


def zero_shot(source: Known, target: Known) -> float:
    """Return the score that the source's network reaches in the target before it is trained there."""
    return target.score(target.greedy_episode(source.network))


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


MEASURES = {
    **{name: from_cases(measure) for name, measure in of_cases.MEASURES.items()},
    "visits": Measure(visits),
    "zero_shot": Measure(zero_shot),
    "agreement": Measure(agreement),
    "logme": Measure(logme_of_actions),
    "gradient": Measure(gradient),
}
