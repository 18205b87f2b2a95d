"""Roll out a transfer's policy on its source while it trains on the target, to see what it forgets."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Generator

from ship_trl.config.types import Schedule
from ship_trl.learn.backend import Draw
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import mean_return, rollout
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run.run import Run
from ship_trl.run.source import Source
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.starts import make_starts

# Evaluations on the source in a run, evenly, the first and the last included. They take about 1 % of a run of
# pixels and 2 % of one of vectors in profile quick; at each of its 121 evaluations 4 % and 9 %.
MAX_EVALUATIONS = 20


@dataclass(frozen=True)
class SourceCheck:
    """Measures greedy returns on the source; it draws no random number and changes nothing of the training.

    `env` begins each case of the source once, `draw` maps states to the network's input, and
    `source_return` is the source network's own return.
    """

    env: ShipEnv
    draw: Draw
    learn: Schedule
    source_return: float = math.nan

    def measure(self, network: DuelingNetwork) -> float:
        """Return the mean greedy return of a network on the source."""
        return mean_return(rollout(self.env, greedy_policy(network, self.draw)))

    def is_due(self, episode: int) -> bool:
        """Return whether the evaluation after `episode` training episodes is one of those to measure."""
        last, number = (math.ceil(n / self.learn.evaluate_every) for n in (self.learn.episodes, episode))
        steps = min(MAX_EVALUATIONS - 1, last)
        return number == 0 or number * steps // last > (number - 1) * steps // last

    def add(self, event: Finished | Evaluated, network: DuelingNetwork) -> Finished | Evaluated:
        """Add the return on the source to an evaluation of `network`, if it is due."""
        if isinstance(event, Finished) or not self.is_due(event.episode):
            return event
        return replace(event, source_return=self.measure(network))


def make_source_check(run: Run, source: Source | None, device: torch.device) -> SourceCheck | None:
    """Make the check of a transfer on its source; None if the source is drawn or has other actions."""
    if source is None or run.source_suite is None:
        return None
    config, suite = run.config, run.source_suite
    network = make_network(config.network, len(config.world.actions), Generator(), colour=config.colour)
    if source.weights.keys() != network.state_dict().keys():
        return None
    network.load_state_dict(dict(source.weights))
    starts = make_starts(suite, config.world).balanced(len(suite.cases), Generator())
    env = ShipEnv(
        suite,
        config.world,
        starts=starts,
        colour=config.colour,
        vector_time=config.network.vector_time,
        device=device,
        fast=config.fast,
    )
    check = SourceCheck(env, env.observer(config.network), config.learn)
    return replace(check, source_return=check.measure(network.to(device)))
