"""QDagger: the target's policy follows the source's until it is as good (Agarwal et al., 2022).

The loss gets weight * max(0, 1 - share) * KL(softmax(Q_source / t), softmax(Q / t)), with Q-values in raw
rewards. The share is how far the mean return of the last training episodes, which explore and pay the margin,
has come from the untrained network's greedy return to the source's. In the paper it is the ratio of the two
returns, which means nothing where returns are negative. There the target first learns offline from the
source's episodes; here it does not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from ship_trl.config.arm import Form
from ship_trl.config.bounds import LossWeight
from ship_trl.transfer.methods.base import Origin, TransferMethod

if TYPE_CHECKING:
    from tensordict import TensorDictBase
    from torch import Tensor, nn

# Training episodes whose mean return is compared with the source's.
EPISODES = 10


@dataclass(frozen=True)
class Settings:
    """How strongly the policy is pulled to the source's."""

    weight: LossWeight = 3.0
    temperature: Annotated[float, Field(gt=0, le=1e6)] = 1.0


FORM = Form("QD", bare=True, uses_function=True, settings=Settings)


class Method(TransferMethod):
    """Copies the arm's layers, if any, and adds the divergence from the source's policy to the loss."""

    settings: Settings

    def attach(self, origin: Origin) -> None:
        """Take the source's function, whose returns are compared with the target's."""
        super().attach(origin)
        self._returns: deque[float] = deque(maxlen=EPISODES)
        self._running: Tensor | None = None

    @property
    def weight(self) -> float:
        """The weight of the divergence now; 0 if the source is no better than an untrained network."""
        low, high = self._origin.untrained_return, self._origin.episode_return
        if high <= low:
            return 0.0
        score = sum(self._returns) / len(self._returns) if self._returns else low
        return self.settings.weight * min(1.0, max(0.0, 1.0 - (score - low) / (high - low)))

    def observe(self, step: TensorDictBase) -> None:
        """Add rewards to the returns of the running episodes, and note those that end."""
        following = step.get("next")
        reward, done = following.get("reward").squeeze(-1), following.get("done").squeeze(-1)
        # A checkpoint's is on the CPU.
        running = reward if self._running is None else self._running.to(reward.device) + reward
        self._returns.extend(running[done].tolist())
        self._running = running.masked_fill(done, 0.0)

    def penalty(self, network: nn.Module, batch: TensorDictBase) -> Tensor | None:
        """Return the weighted divergence on a batch, or None while its weight is 0."""
        import torch
        from torch import nn

        from ship_trl.learn.network import DuelingNetwork

        if not (weight := self.weight):
            return None
        assert isinstance(network, DuelingNetwork)
        observation, temperature = batch.get(network.observes), self.settings.temperature
        with torch.no_grad():
            source_q = self._origin.network(observation) / self._origin.source_scale
            source_policy = (source_q / temperature).log_softmax(-1)
        policy = (network(observation) / self._origin.reward_scale / temperature).log_softmax(-1)
        return weight * nn.functional.kl_div(policy, source_policy, reduction="batchmean", log_target=True)

    def state_dict(self) -> dict[str, Tensor]:
        """Return the returns of the last and of the running episodes."""
        import torch

        running = torch.empty(0) if self._running is None else self._running
        return {"returns": torch.tensor(list(self._returns), dtype=torch.float64), "running": running}

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned."""
        self._returns.clear()
        self._returns.extend(state["returns"].tolist())
        self._running = state["running"].clone() if len(state["running"]) else None
