"""AggreVaTe (Ross and Bagnell, arXiv 1406.5979): a network learns what an expert would still earn.

The expert follows held manoeuvres to their end in the simulator (`fast.plans`). What the best manoeuvre earns
that begins with each action is the action's value, on states that the network visits itself. No reward is
bootstrapped, so minutes are enough; and as the network chooses anew in each step, it may do better than any
held manoeuvre.
"""

from __future__ import annotations

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor

from ship_trl.learn import settings as settings_of
from ship_trl.learn.algorithm import Setup
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.masks import mask_of, mask_values
from ship_trl.learn.network import Draw
from ship_trl.learn.pupil import distillation_loss
from ship_trl.learn.replay import StateReplay

# Key of the expert's values, float32 [N, A].
VALUE = "expert_value"


class ExpertReplay(StateReplay):
    """Replay of states with the expert's values, computed once."""

    def entries(self, step: TensorDictBase) -> dict[NestedKey, Tensor]:
        """Return what is stored of a step."""
        return super().entries(step) | {VALUE: step.get(VALUE)}


class Aggrevate(DoubleDQN):
    """Double DQN's schedule and running average, with an expert's values as targets.

    At first mostly the expert acts, then the network, with random actions between.
    """

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup, make_replay=lambda *given, **_: ExpertReplay(*given[:4]))
        assert setup.teacher is not None, "the configuration asks for an expert"
        self.expert = setup.teacher
        self.settings = settings_of.Aggrevate(**{k: v for k, v in setup.options.items() if k != "build"})

    def make_encoders(self) -> dict[str, Draw]:
        """Return none: the replay holds states."""
        return {}

    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action` and the expert's values, when `episode` training episodes have ended."""
        step = super().act(step, episode)
        state, action = step["state"], step["action"]
        value = self.expert(state)
        own = min(1.0, episode / (self.settings.own_fraction * self.learn.episodes))
        is_own = torch.rand(len(state), generator=self.exploration, device=state.device) < own
        best = mask_values(value, mask_of(step)).argmax(-1)
        step.set("action", torch.where(is_own, action, best))
        return step.set(VALUE, value)

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Compare Q-values with the expert's values, which count down to `worst` below the best one."""
        wanted = batch[VALUE]
        worst = self.settings.worst * self.learn.reward_scale
        wanted = wanted.clamp(min=wanted.amax(-1, keepdim=True) - worst)
        q = self.online_network(self.draw(batch["state"]))
        weights = self.settings.temperature, self.settings.huber_weight, self.learn.huber_delta
        return distillation_loss(q, wanted, *weights)


def build(setup: Setup) -> Aggrevate:
    """Make the learner with the settings of `setup.options`."""
    return Aggrevate(setup)
