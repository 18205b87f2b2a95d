"""The double-DQN loss (equations 1 and 2, with van Hasselt's choice of the action)."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor

from ship_trl.config import Loss


def double_dqn_target(
    online: Tensor, slow: Tensor, reward: Tensor, terminated: Tensor, gamma: float
) -> Tensor:
    """What Q(s, a) should be: the online network chooses the next action, the target network values it.

    A truncated step is not terminated, so it bootstraps.
    Shapes: Q-values of the next states [B, A] of both networks, reward and terminated [B, 1];
    returns [B, 1].
    """
    choice = online.argmax(-1, keepdim=True)
    return reward + gamma * slow.gather(-1, choice) * ~terminated


def td_loss(q: Tensor, action: Tensor, wanted: Tensor, kind: Loss, huber_delta: float = 1.0) -> Tensor:
    """Mean squared (equation 2) or Huber's loss: Q-values [B, A], actions [B], wanted [B, 1].

    Huber's is half the square of errors below `huber_delta`, in scaled rewards, and grows in proportion
    to them above.
    """
    got = q.gather(-1, action.unsqueeze(-1))
    return F.mse_loss(got, wanted) if kind is Loss.l2 else F.huber_loss(got, wanted, delta=huber_delta)
