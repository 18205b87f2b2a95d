"""A guide: in training the source chooses some of the actions, and the target learns from what follows.

Three schedules of its probability, over training and over an episode:

- belief: after the belief-based transfer of Liu and Jin (2018 to 2020). Their schedule is not published; a
  straight fall over training is our reading, so this is no reproduction.
- reuse: probabilistic policy reuse (Fernandez and Veloso, 2006) of one source. There it begins with 1 and
  goes on in all episodes (`belief=1 period=1`); here it ends after `period`.
- jumpstart: the first steps of an episode (JSRL; Uchendu et al., 2023). There they become fewer as the agent
  improves, here in a straight fall over training.

Double DQN learns from any actions, so these steps enter the replay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from ship_trl.config.arm import Form
from ship_trl.config.bounds import Count, PositiveShare, Share
from ship_trl.transfer.methods.base import TransferMethod

if TYPE_CHECKING:
    from tensordict import TensorDictBase
    from torch import Tensor

Schedule = StrEnum("Schedule", ["belief", "reuse", "jumpstart"])


@dataclass(frozen=True)
class Settings:
    """When the source chooses the action."""

    schedule: Schedule = Schedule.belief
    belief: Share = 0.9
    period: PositiveShare = 0.2
    decay: Share = 0.95
    steps: Count = 20


FORM = Form("G", bare=True, uses_function=True, settings=Settings)


def probability(settings: Settings, progress: float, step: Tensor) -> Tensor:
    """Return the probability [N] of the source's action in steps [N] of episodes, at a share of training."""
    import torch

    left = max(0.0, 1.0 - progress / settings.period)
    if settings.schedule is Schedule.belief:
        return torch.full_like(step, settings.belief * left)
    if settings.schedule is Schedule.reuse:
        return settings.belief * settings.decay**step * (left > 0)
    return (step < settings.steps * left).to(step.dtype)


class Method(TransferMethod):
    """Copies the arm's layers, if any, and lets the source choose some of the actions."""

    settings: Settings

    def act(self, step: TensorDictBase, progress: float) -> None:
        """Replace `action` [N] by the source's best one, with the probability of the schedule."""
        import torch

        from ship_trl.learn.masks import mask_of, mask_values
        from ship_trl.sim.state import STEP

        state, generator = step.get("state"), self._origin.generator
        chance = probability(self.settings, progress, state[..., STEP])
        guided = torch.rand(len(state), generator=generator, device=state.device) < chance
        if bool(guided.any()):
            best = mask_values(self._origin.q_values(state), mask_of(step)).argmax(-1)
            step.set("action", torch.where(guided, best, step.get("action")))

    def state_dict(self) -> dict[str, Tensor]:
        """Return the state of the generator."""
        return {"generator": self._origin.generator.get_state()}

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load the state of the generator."""
        self._origin.generator.set_state(state["generator"].cpu())
