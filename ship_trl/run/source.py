"""The source network of a transfer: its weights and origin, and what the transfer forgets of its case."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Generator

from ship_trl.config.arm import FORMS, SourceWeights
from ship_trl.config.types import Schedule
from ship_trl.fast import worlds as fast
from ship_trl.learn.backend import Draw
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import mean_return, rollout
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.policies.pretrained import PRETRAINED
from ship_trl.run.run import Run
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.suites import Suite
from ship_trl.transfer.casebase import Entry
from ship_trl.transfer.weights import Weights, load_weights, permute_values

# Evaluations on the source in a run, evenly, the first and the last included. They take about 1 % of a run of
# pixels and 2 % of one of vectors in profile quick; at each of its 121 evaluations 4 % and 9 %.
MAX_EVALUATIONS = 20


@dataclass(frozen=True)
class Source:
    """The weights that a transfer copies from, and their origin for people."""

    weights: Weights
    origin: str


def read_source(run: Run, entry: Entry | None = None) -> Source | None:
    """Read or draw the source's weights as the run's arm asks; return None for a run from scratch.

    `entry` is the source network in the case base; None if it is bundled, a file, or random.
    """
    if run.arm.is_scratch:
        return None
    config = run.config
    actions = len(config.world.actions)
    network = make_network(config.network, actions, Generator(), colour=config.colour)
    if run.arm.weights is SourceWeights.random:
        # An untrained network with the target's layers, drawn from a random stream of its own.
        network.reset(Generator().manual_seed(run.stream("random source")))
        return Source(network.state_dict(), SourceWeights.random.value)
    if run.pretrained:
        path, key, origin = run.pretrained.file, "source", f"{PRETRAINED}:{run.pretrained.name}"
    elif entry:
        path, key, origin = entry.policy, "case_base", str(entry.policy)
    else:
        path, key, origin = Path(str(config.source_file)), "source_file", str(config.source_file)
    copied = run.arm.copied(network.all_layers, network.layer_names)
    # A source may have another number of actions where its Q-values are neither copied nor asked for.
    needs_all = FORMS[run.arm.method].uses_function or "advantage" in copied
    weights = load_weights(path, network, key, free=() if needs_all else ("advantage",))
    if run.arm.weights is SourceWeights.permuted:
        weights = permute_values(weights, Generator().manual_seed(run.stream("permuted source")))
    return Source(weights, origin)


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


def make_run_env(run: Run, suite: Suite, device: torch.device, **given: Any) -> ShipEnv:
    """Make an environment with the settings of a run and those that are `given`."""
    config = run.config
    look: dict[str, Any] = {"colour": config.colour, "vector_time": config.network.vector_time}
    given |= look | {"device": device, "fast": config.fast}
    return fast.make_env(suite, config.world, **given)


def make_source_check(run: Run, source: Source | None, device: torch.device) -> SourceCheck | None:
    """Make the check of a transfer on its source; None if the source is drawn or has other actions."""
    if source is None or run.source_suite is None:
        return None
    config, suite = run.config, run.source_suite
    network = make_network(config.network, len(config.world.actions), Generator(), colour=config.colour)
    if source.weights.keys() != network.state_dict().keys():
        return None
    network.load_state_dict(dict(source.weights))
    starts = fast.make_starts(suite, config.world).balanced(len(suite.cases), Generator())
    env = make_run_env(run, suite, device, starts=starts)
    check = SourceCheck(env, env.observer(config.network), config.learn)
    return replace(check, source_return=check.measure(network.to(device)))
