"""The seam between the training loop and what learns.

The loop knows an `Algorithm` and nothing of replay, loss or exploration. A builder, named by the setting
`algorithm.build`, makes one from a `Setup`. `double_dqn.build` is the paper's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor, nn

from ship_trl.config.imports import import_function, name_in_errors
from ship_trl.config.types import Learn
from ship_trl.learn.backend import Accelerator, Draw
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Policy

# Q-values [N, A] of states [N, S].
Teacher = Callable[[Tensor], Tensor]


class DivergedError(Exception):
    """A loss, weight or output is not finite."""


class Algorithm(Protocol):
    """Acts in a batched environment and learns from what follows."""

    @property
    def encoders(self) -> Mapping[str, Callable[[Tensor], Tensor]]:
        """Further observations that the environment gives, each a function of states [N, S]."""
        ...

    @property
    def network(self) -> DuelingNetwork:
        """The network of the greedy policy, which is evaluated and saved."""
        ...

    @property
    def greedy(self) -> Policy:
        """The policy of evaluations, which draws no random number."""
        ...

    @property
    def epsilon(self) -> float:
        """Share of random actions; NaN where actions are drawn otherwise."""
        ...

    @property
    def dtype(self) -> torch.dtype:
        """Number format of the conv layers in training."""
        ...

    @property
    def backend(self) -> str:
        """Name of what computes the conv layers in training."""
        ...

    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action` [N] of the exploring policy, when `episode` training episodes have ended."""
        ...

    def observe(self, step: TensorDictBase) -> None:
        """Take note of a step [N] of the environment, with `action` and `next`."""
        ...

    def update(self) -> list[Tensor]:
        """Make the updates that are due, and return their losses."""
        ...

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to go on with the same bits; tensors are not copied."""
        ...

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned.

        Raises:
            KeyError, RuntimeError: the state does not fit this algorithm.
        """
        ...


class LearningHooks:
    """What a method of transfer asks of an algorithm while it learns: from scratch, nothing.

    Attributes:
        thaws: whether layers that are frozen at first learn later.
    """

    thaws = False

    def frozen_layers(self, progress: float) -> int:
        """Return how many layers, counted from the input, do not learn at a share of the episodes."""
        return 0

    def rate_factor(self, layer: str) -> float:
        """Return the factor of the learning rate of a layer of the network."""
        return 1.0

    def penalty(self, network: nn.Module, batch: TensorDictBase) -> Tensor | None:
        """Return what is added to the loss of a batch, or None for nothing."""
        return None

    def act(self, step: TensorDictBase, progress: float) -> None:
        """Change `action` [N] of a step, which the exploring policy has chosen; `progress` as above."""

    def observe(self, step: TensorDictBase) -> None:
        """Take note of a step [N] of the environment, with `action` and `next`."""

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to go on with the same bits; tensors are not copied."""
        return {}

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned."""


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


def epsilon_at(episode: float, learn: Learn) -> float:
    """Return the exploration rate after `episode` episodes: linear over `epsilon_fraction`, then constant."""
    share = min(1.0, episode / (learn.epsilon_fraction * learn.episodes))
    return learn.epsilon_start + share * (learn.epsilon_end - learn.epsilon_start)


def learning_rate_at(episode: float, learn: Learn) -> float:
    """Return the learning rate after `episode` episodes: linear from `lr` to `lr_end`."""
    return learn.lr + min(1.0, episode / learn.episodes) * (learn.lr_end - learn.lr)


def build_algorithm(setup: Setup) -> Algorithm:
    """Make the algorithm whose builder `setup.options["build"]` names.

    Raises:
        ConfigError: there is no such builder, or it refuses its settings.
    """
    name = setup.options["build"]
    build: Callable[[Setup], Algorithm] = import_function(name, "algorithm.build", "setup")
    with name_in_errors(f"algorithm.build: {name} fails"):
        return build(setup)
