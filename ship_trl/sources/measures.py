"""Measures of similarity by name: of two cases, and of what the source's network reaches in the target.

`benchmarks/measures.py` has others that were judged (docs/sources.md). One that wins belongs here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Self

from torch import Generator, Tensor

from ship_trl.config.types import World
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import Episode, rollout
from ship_trl.policies.random_policy import random_return
from ship_trl.policies.reference import best_known
from ship_trl.sim.cases import Case
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.suites import suite_of
from ship_trl.transfer import similarity as of_cases
from ship_trl.transfer.layers import load_weights, read_look
from ship_trl.transfer.similarity import Measure


class Known:
    """A case, and a network that was trained on it or None."""

    def __init__(self, case: Case, world: World, network: DuelingNetwork | None = None) -> None:
        self.case, self.suite = case, suite_of(case)
        self.world = world
        self._network = network

    @classmethod
    def load(cls, case: Case, world: World, path: Path) -> Self:
        """Read the network from a safetensors file.

        Raises:
            ConfigError: the file holds no network for this world.
        """
        config, colour = read_look(path, "source_file")
        network = make_network(config, len(world.actions), Generator(), colour=colour)
        network.load_state_dict(dict(load_weights(path, network)))
        return cls(case, world, network)

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
        return ShipEnv(self.suite, self.world).observer(network.config, network.colour)

    def greedy_episode(self, network: DuelingNetwork) -> Episode:
        """Return the greedy episode of a network in the case."""
        env = ShipEnv(self.suite, self.world)
        (episode,) = rollout(env, greedy_policy(network, self.observer(network)))
        return episode

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """The mean return of random actions, and the best known return."""
        return random_return(self.suite, self.world), best_known(self.case, self.world).episode_return


def from_cases(measure: Measure) -> Measure:
    """Make a measure of two cases one of what is known of them."""

    def value(source: Known, target: Known) -> float:
        return measure.value(source.case, target.case, target.world)

    return Measure(value, measure.nearer)


def zero_shot(source: Known, target: Known) -> float:
    """Return the score that the source's network reaches in the target before it is trained there.

    0 is the return of random actions or less, 1 the best known return.
    """
    reached, (random, known) = target.greedy_episode(source.network).episode_return, target.bounds
    return max(0.0, (reached - random) / (known - random))


MEASURES = {name: from_cases(measure) for name, measure in of_cases.MEASURES.items()}
MEASURES["zero_shot"] = Measure(zero_shot)
