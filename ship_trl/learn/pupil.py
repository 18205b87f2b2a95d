"""Policy distillation (Rusu et al., 2016): a pupil learns the Q-values of a teacher, and needs no rewards.

The teacher is a trained network of the same world, such as one of numbers (`observation=vector`), which
learns in minutes what takes hours from pixels. At first the teacher acts, then more and more the pupil: it
learns on states that it visits itself (DAgger; Ross et al., 2011).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from ship_trl.learn import settings as settings_of
from ship_trl.learn.algorithm import Setup
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.masks import mask_values
from ship_trl.learn.network import Draw
from ship_trl.learn.replay import StateReplay

# The wider the range of its Q-values (scaled rewards), the likelier a state is learned; between these bounds.
LEAST_RANGE, MOST_RANGE = 0.01, 6.0


def distillation_loss(
    q: Tensor, teacher_q: Tensor, temperature: float, huber_weight: float, huber_delta: float = 1.0
) -> Tensor:
    """Compare Q-values [B, A] with the teacher's: KL divergence of their softmax, and Huber's loss.

    The divergence asks for the right action where Q-values are almost equal, and Huber's loss for their size.
    """
    log, teacher_log = ((each / temperature).log_softmax(-1) for each in (q, teacher_q))
    divergence = F.kl_div(log, teacher_log, reduction="batchmean", log_target=True)
    return divergence + huber_weight * F.huber_loss(q, teacher_q, delta=huber_delta)


class Pupil(DoubleDQN):
    """Double DQN's replay, schedule and running average, with the teacher's Q-values as targets.

    Evaluations use the running average here too: the online network changes some choices in each update.
    """

    def __init__(self, setup: Setup) -> None:
        # The replay holds states alone, which teacher and pupil see each in its own way.
        super().__init__(setup, make_replay=lambda *given, **_: StateReplay(*given[:4]))
        assert setup.teacher is not None, "the configuration names a teacher"
        self.teacher, self.mirror = setup.teacher, setup.mirror
        self.settings = settings_of.Pupil(**{k: v for k, v in setup.options.items() if k != "build"})
        # Probability that the pupil chooses, else the teacher.
        self.own = 0.0

    def make_encoders(self) -> dict[str, Draw]:
        """Return none."""
        return {}

    def best_actions(self, observed: Tensor, allowed: Tensor | None = None) -> Tensor:
        """Return the best allowed actions int64 [N] of states [N, S], by pupil or teacher."""
        action = mask_values(self.teacher(observed), allowed).argmax(-1)
        own = torch.rand(len(observed), generator=self.exploration, device=observed.device) < self.own
        if own.any():
            action[own] = super().best_actions(observed[own], None if allowed is None else allowed[own])
        return action

    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action`, when `episode` training episodes have ended."""
        self.own = min(1.0, episode / (self.settings.own_fraction * self.learn.episodes))
        return super().act(step, episode)

    @torch.no_grad()
    def sample(self) -> TensorDictBase:
        """Draw a batch with `teacher_q` [B, A], the likelier where the choice of an action matters more.

        On open sea Q-values hardly differ. So several states are drawn for each that is learned, and chosen
        by the range of the teacher's Q-values, which costs little if the teacher sees numbers.
        """
        count = self.learn.batch_size
        state = self.replay.sample(self.settings.candidates * count)["state"]
        if self.mirror is not None:
            # The teacher knows the Q-values of any state, so half of them may be mirror images.
            state = state.clone()
            state[1::2] = self.mirror(state[1::2])
        q = self.teacher(state)
        weight = (q.amax(-1) - q.amin(-1)).clamp(LEAST_RANGE, MOST_RANGE)
        chosen = torch.multinomial(weight, count, generator=self.replay.generator)
        return TensorDict({"state": state[chosen], "teacher_q": q[chosen]}, [count], state.device)

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Compute the loss of `state` [B, S], and write what the network sees of it."""
        seen = self.draw(batch["state"])
        batch.set(self.online_network.observes, seen)
        weights = self.settings.temperature, self.settings.huber_weight, self.learn.huber_delta
        return distillation_loss(self.online_network(seen), batch["teacher_q"], *weights)


def build(setup: Setup) -> Pupil:
    """Make a pupil of `setup.teacher` with the settings of `config.algorithm`."""
    return Pupil(setup)
