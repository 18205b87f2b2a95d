"""The seam between the training loop and what learns.

The loop knows an `Algorithm` and nothing of replay, loss or exploration. A builder, named by the setting
`algorithm.build`, makes one from a `Setup`. `double_dqn.build` is the paper's.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor

from ship_trl.config.imports import import_function, name_in_errors
from ship_trl.config.types import Learn
from ship_trl.learn.hooks import LearningHooks
from ship_trl.learn.masks import ACTION_MASK, Mask
from ship_trl.learn.network import Dense, Draw, DuelingNetwork, MakeBackend, make_backend
from ship_trl.learn.optimiser import ChannelsLastAdam, learning_groups
from ship_trl.learn.rollout import Policy, greedy_policy

# Q-values [N, A] of states [N, S].
Teacher = Callable[[Tensor], Tensor]


class DivergedError(Exception):
    """A loss, weight or output is not finite."""


@dataclass(frozen=True)
class Accelerator:
    """What makes learning faster than torch alone; None where nothing does. `ship_trl.fast` has both.

    Attributes:
        backend: makes a backend for the CPU that computes less than every pixel or place of a ship.
        capture: makes a function of tensors on a GPU that does the same with less overhead.
    """

    backend: MakeBackend | None = None
    capture: Callable[[Callable[..., Any]], Callable[..., Any]] | None = None


@dataclass(frozen=True)
class Setup:
    """What a builder makes an algorithm from.

    Attributes:
        network: the initial weights, on the device of the training.
        draw: maps states to the network's input.
        num_actions: A.
        learn: hyperparameters.
        exploration: random generator of the acting policy, on the device.
        replay: random generator of the batches, on the device.
        method: what a transfer asks of learning.
        options: the settings below `algorithm`.
        teacher: the network that `algorithm.teacher` names; None without one.
        mirror: maps states to those with port and starboard exchanged; None in a world without.
        accelerator: what makes learning faster.
        mask: says which actions may be taken, in training and by the greedy policy; None for all.
    """

    network: DuelingNetwork
    draw: Draw
    num_actions: int
    learn: Learn
    exploration: Generator
    replay: Generator
    method: LearningHooks = field(default_factory=LearningHooks)
    options: Mapping[str, Any] = field(default_factory=dict)
    teacher: Teacher | None = None
    mirror: Callable[[Tensor], Tensor] | None = None
    accelerator: Accelerator = field(default_factory=Accelerator)
    mask: Mask | None = None


class Algorithm(ABC):
    """Acts in a batched environment and learns from what follows.

    Attributes:
        online_network: the network that learns, `setup.network`.
        network: of the greedy policy, which is evaluated and saved.
        greedy: the policy of evaluations, which draws no random number.
        encoders: further observations that the environment gives, each a function of states [N, S]; one is
            `action_mask` if there is a mask.
        epsilon: share of random actions; NaN where actions are drawn otherwise.
        optimiser: of the layers that learn.
        exploration: random generator of the acting policy.
        dtype: number format of the conv layers in training.
        backend: name of what computes the conv layers in training.
    """

    epsilon = math.nan

    def __init__(self, setup: Setup) -> None:
        self.draw, self.learn, self.method = setup.draw, setup.learn, setup.method
        self.exploration, self.mask = setup.exploration, setup.mask
        self.online_network = network = setup.network
        network.freeze(self.method.frozen_layers(0.0))
        network.backend = make_backend(network, self.draw, self.learn, setup.accelerator.backend)
        self.dtype, self.backend = network.backend.dtype, network.backend.name
        self.optimiser = ChannelsLastAdam(learning_groups(network, self.method.rate_factor), self.learn.lr)
        self.encoders: dict[str, Draw] = {} if setup.mask is None else {ACTION_MASK: setup.mask}
        self.evaluate_with(network)

    def evaluate_with(self, network: DuelingNetwork) -> None:
        """Let evaluations use the weights of a network. They compute whole frames in float32."""
        self.network: DuelingNetwork = copy.copy(network)
        self.network.backend = Dense()
        self.greedy: Policy = greedy_policy(self.network, self.draw, self.mask)

    def schedule(self, episode: int) -> float:
        """Set what changes over the training, and return the share of the episodes that have ended."""
        progress = episode / self.learn.episodes
        self.freeze(self.method.frozen_layers(progress))
        self.optimiser.set_lr(learning_rate_at(episode, self.learn))
        return progress

    def freeze(self, layers: int) -> None:
        """Freeze the first `layers` layers, and let the others learn."""
        if layers != self.online_network.frozen:
            self.online_network.freeze(layers)
            self.optimiser.add_thawed(self.online_network)

    @abstractmethod
    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action` [N] of the exploring policy, when `episode` training episodes have ended."""

    @abstractmethod
    def observe(self, step: TensorDictBase) -> None:
        """Take note of a step [N] of the environment, with `action` and `next`."""

    @abstractmethod
    def update(self) -> list[Tensor]:
        """Make the updates that are due, and return their losses."""

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to go on with the same bits; tensors are not copied."""
        return {
            **add_prefix("online", self.online_network.state_dict()),
            **add_prefix("adam", self.optimiser.averages(self.online_network)),
            **add_prefix("method", self.method.state_dict()),
            "exploration": self.exploration.get_state(),
            "frozen": torch.tensor(self.online_network.frozen),
        }

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned, into the memory of the networks.

        Raises:
            KeyError, RuntimeError, TypeError, ValueError: the state does not fit this algorithm.
        """
        self.freeze(int(state["frozen"]))
        self.online_network.load_state_dict(strip_prefix("online", state))
        self.optimiser.load_averages(self.online_network, strip_prefix("adam", state))
        self.method.load_state_dict(strip_prefix("method", state))
        self.exploration.set_state(state["exploration"].cpu())


def epsilon_at(episode: float, learn: Learn) -> float:
    """Return the exploration rate after `episode` episodes: linear over `epsilon_fraction`, then constant."""
    share = min(1.0, episode / (learn.epsilon_fraction * learn.episodes))
    return learn.epsilon_start + share * (learn.epsilon_end - learn.epsilon_start)


def learning_rate_at(episode: float, learn: Learn) -> float:
    """Return the learning rate after `episode` episodes: linear from `lr` to `lr_end`."""
    return learn.lr + min(1.0, episode / learn.episodes) * (learn.lr_end - learn.lr)


def add_prefix(name: str, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Prefix each key of a part of a checkpoint with a name and a dot."""
    return {f"{name}.{key}": value for key, value in state.items()}


def strip_prefix(name: str, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the entries whose key has a name and a dot as prefix, and strip the prefix."""
    return {key.removeprefix(f"{name}."): v for key, v in state.items() if key.startswith(f"{name}.")}


def build_algorithm(setup: Setup) -> Algorithm:
    """Make the algorithm whose builder `setup.options["build"]` names.

    Raises:
        ConfigError: there is no such builder, or it refuses its settings.
    """
    name = setup.options["build"]
    build: Callable[[Setup], Algorithm] = import_function(name, "algorithm.build", "setup")
    with name_in_errors(f"algorithm.build: {name} fails"):
        return build(setup)
