"""An algorithm of one's own: Munchausen DQN (Vieillard et al., 2020), built from the package's parts.

    python -m ship_trl target=2 method=scratch algorithm.build=examples/own_algorithm.py:build profile=smoke

A builder gets a `Setup` and returns an `Algorithm` (ship_trl/learn/algorithm.py). This one is double DQN
with another loss: the target adds the clipped log-probability of the action, and averages over a soft policy.
Results, checkpoints, transfer and pictures are the same as in any other run.
"""

import torch
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.learn.algorithm import Setup
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.learn.q_learning import td_loss

# Weight of the log-probability, its least value, and the temperature of the policy in scaled rewards.
ALPHA, LEAST, TEMPERATURE = 0.9, -1.0, 0.03


class MunchausenDQN(DoubleDQN):
    """Double DQN with a soft target."""

    def soft(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Return the target network's Q-values and the policy's log-probabilities times the temperature."""
        q: Tensor = self.target_network(observation)
        return q, TEMPERATURE * torch.log_softmax(q / TEMPERATURE, -1)

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Return the mean loss of transitions [B]."""
        # Pixels, or features where layers are frozen.
        key, following, learn = self.observed, batch["next"], self.learn
        action = batch["action"].unsqueeze(-1)
        with torch.no_grad():
            _, bonus = self.soft(batch[key])
            next_q, next_bonus = self.soft(following[key])
            value = ((next_bonus / TEMPERATURE).exp() * (next_q - next_bonus)).sum(-1, keepdim=True)
            reward = following["reward"] + ALPHA * bonus.gather(-1, action).clamp(min=LEAST)
            td_target = reward + learn.gamma * value * ~following["terminated"]
        q = self.online_network(batch[key]).gather(-1, action)
        return td_loss(q, td_target, learn.loss, learn.huber_delta)


def build(setup: Setup) -> DoubleDQN:
    """Make double DQN with this loss."""
    return MunchausenDQN(setup)
