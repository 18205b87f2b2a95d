"""Policy distillation (Rusu et al., 2016): a pupil learns the Q-values of a teacher, and needs no rewards.

The teacher is a trained network of the same world, such as one of numbers (`observation=vector`), which
learns in minutes what takes hours from pixels. At first the teacher acts, then more and more the pupil: it
learns on states that it visits itself (DAgger; Ross et al., 2011).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
import torch.nn.functional as F
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor
from torchrl.modules import QValueActor

from ship_trl.learn import settings as settings_of
from ship_trl.learn.algorithm import Setup, Teacher
from ship_trl.learn.backend import Draw, make_backend
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam, learning_groups
from ship_trl.learn.policy import EpsilonGreedy
from ship_trl.learn.q_learning import DoubleDQNLoss
from ship_trl.learn.replay import StateReplay


def distillation_loss(
    q: Tensor, teacher_q: Tensor, temperature: float, huber_weight: float, huber_delta: float = 1.0
) -> Tensor:
    """Compare Q-values [B, A] with the teacher's: KL divergence of their softmax, and Huber's loss.

    The divergence asks for the right action where Q-values are almost equal, and Huber's loss for their size.
    """
    log, teacher_log = ((each / temperature).log_softmax(-1) for each in (q, teacher_q))
    divergence = F.kl_div(log, teacher_log, reduction="batchmean", log_target=True)
    return divergence + huber_weight * F.huber_loss(q, teacher_q, delta=huber_delta)


class PupilLoss(DoubleDQNLoss):
    """Loss of states by the teacher's Q-values; networks and running average are those of `DoubleDQNLoss`."""

    def __init__(
        self,
        value_network: QValueActor,
        teacher: Teacher,
        draw: Draw,
        mirror: Callable[[Tensor], Tensor] | None,
        settings: settings_of.Pupil,
        **others: Any,
    ) -> None:
        super().__init__(value_network, **others)
        self.teacher, self.draw, self.mirror, self.settings = teacher, draw, mirror, settings

    def forward(self, tensordict: TensorDictBase) -> TensorDict:
        """Compute the loss of `state` [B, S], and write what the network sees of it."""
        state = tensordict["state"]
        if self.mirror is not None:
            # The teacher knows the Q-values of any state, so half of the batch may be mirror images.
            state = state.clone()
            state[1::2] = self.mirror(state[1::2])
        seen = self.draw(state)
        tensordict.set(self.network.observes, seen)
        with torch.no_grad():
            teacher_q = self.teacher(state)
        weights = self.settings.temperature, self.settings.huber_weight, self.huber_delta
        return TensorDict({"loss": distillation_loss(self.network(seen), teacher_q, *weights)})


class Mixture:
    """Best actions int64 [N] of states [N, S]: with probability `own` the pupil's, else the teacher's."""

    def __init__(self, network: DuelingNetwork, draw: Draw, teacher: Teacher, generator: Generator) -> None:
        self._network, self._draw, self._teacher, self._generator = network, draw, teacher, generator
        self.own = 0.0

    def __call__(self, state: Tensor) -> Tensor:
        """Choose an action for each row."""
        action = self._teacher(state).argmax(-1)
        own = torch.rand(len(state), generator=self._generator, device=state.device) < self.own
        if own.any():
            action[own] = self._network(self._draw(state[own])).argmax(-1)
        return action


class Pupil(DoubleDQN):
    """Double DQN's replay, schedule and running average, with the teacher's Q-values as targets.

    Evaluations use the running average here too: the online network changes some choices in each update.
    """

    def __init__(self, mixture: Mixture, own_fraction: float, **parts: Any) -> None:
        super().__init__(**parts)
        self._mixture, self._own_fraction = mixture, own_fraction

    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action`, when `episode` training episodes have ended."""
        self._mixture.own = min(1.0, episode / (self._own_fraction * self._learn.episodes))
        return super().act(step, episode)


def build(setup: Setup) -> Pupil:
    """Make a pupil of `setup.teacher` with the settings of `config.algorithm`."""
    network, draw, learn, teacher = setup.network, setup.draw, setup.learn, setup.teacher
    assert teacher is not None, "the configuration names a teacher"
    settings = settings_of.Pupil(**{key: value for key, value in setup.options.items() if key != "build"})
    network.freeze(setup.method.frozen_layers(0.0))
    network.backend = make_backend(network, draw, learn, setup.accelerator)
    actor = QValueActor(network, in_keys=[network.observes], action_space="categorical")
    loss = PupilLoss(
        actor, teacher, draw, setup.mirror, settings, huber_delta=learn.huber_delta, gamma=learn.gamma
    )
    mixture = Mixture(network, draw, teacher, setup.exploration)
    device = network.advantage.weight.device
    return Pupil(
        mixture,
        settings.own_fraction,
        loss=loss,
        optimiser=ChannelsLastAdam(learning_groups(network, setup.method.rate_factor), lr=learn.lr),
        replay=StateReplay(learn.replay_size, learn.reward_scale, setup.replay, device),
        policy=EpsilonGreedy(mixture, "state", setup.num_actions, setup.exploration),
        draw=draw,
        learn=learn,
        method=setup.method,
    )
