"""Stable-Baselines3's DQN with the paper's layers: as it is, and as a double dueling one."""

from __future__ import annotations

from typing import Any

import gymnasium
import torch
import torch.nn.functional as F
from stable_baselines3 import DQN
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.utils import polyak_update
from stable_baselines3.dqn.policies import CnnPolicy, QNetwork
from torch import Tensor, nn

from ship_trl.bench.peer_network import DuelingHead, conv_layers, freeze
from ship_trl.config.types import Learn


class PaperFeatures(BaseFeaturesExtractor):
    """The four conv layers of section 3.5; the library scales the pixels."""

    def __init__(self, observation_space: gymnasium.spaces.Box) -> None:
        super().__init__(observation_space, features_dim=200)
        self.convs = nn.ModuleList(conv_layers(observation_space.shape[0]))

    def forward(self, observations: Tensor) -> Tensor:
        """Float [B, C, 84, 84] to [B, 200]."""
        x = observations
        for conv in self.convs:
            x = F.relu(conv(x))
        return x.flatten(1)


class DuelingQNetwork(QNetwork):
    """The library's Q-network with value and advantage in place of its fully connected layers."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.q_net = nn.Sequential(DuelingHead(int(self.action_space.n)))


class DuelingPolicy(CnnPolicy):
    """The library's policy for pictures, with dueling networks."""

    def make_q_net(self) -> DuelingQNetwork:
        """Online and target network are both made here."""
        arguments = self._update_features_extractor(self.net_args, features_extractor=None)
        return DuelingQNetwork(**arguments).to(self.device)


class DoubleDQN(DQN):
    """The library's DQN with the double-DQN target, and nothing else changed."""

    @torch.no_grad()
    def td_target(self, batch: ReplayBufferSamples) -> Tensor:
        """Choose by the online network and value by the target network: [B, 1]."""
        best = self.q_net(batch.next_observations).argmax(1, keepdim=True)
        value = self.q_net_target(batch.next_observations).gather(1, best)
        return batch.rewards + (1 - batch.dones) * self.gamma * value

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Gradient steps on batches from the replay."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        assert self.replay_buffer is not None
        for _ in range(gradient_steps):
            self.learn_from(self.replay_buffer.sample(batch_size, env=self._vec_normalize_env))
        self._n_updates += gradient_steps
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")

    def learn_from(self, batch: ReplayBufferSamples) -> None:
        """One gradient step."""
        value = self.q_net(batch.observations).gather(1, batch.actions.long())
        loss = F.smooth_l1_loss(value, self.td_target(batch))
        self.policy.optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
        self.policy.optimizer.step()
        self.logger.record("train/loss", loss.item())


class Sb3Loop:
    """A DQN of Stable-Baselines3 that goes on step by step.

    Args:
        env: a Gymnasium environment of pictures.
        learn: hyperparameters; those that it does not know stay the library's own.
        double: double dueling with a soft target as ours, or the library's DQN as it is.
        frozen: how many conv layers stay as they are.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], learn: Learn, double: bool = True, frozen: int = 0
    ) -> None:
        more: dict[str, Any] = {"tau": learn.tau, "target_update_interval": learn.update_every}
        kwargs: dict[str, Any] = {"features_extractor_class": PaperFeatures}
        self.model = (DoubleDQN if double else DQN)(
            DuelingPolicy if double else "CnnPolicy",
            env,
            learning_rate=learn.lr,
            buffer_size=learn.replay_size,
            learning_starts=learn.warmup_steps,
            batch_size=learn.batch_size,
            gamma=learn.gamma,
            train_freq=learn.update_every,
            gradient_steps=1,
            exploration_initial_eps=learn.epsilon_start,
            exploration_final_eps=learn.epsilon_end,
            policy_kwargs=kwargs | ({} if double else {"net_arch": [200]}),
            device="cpu",
            seed=0,
            **(more if double else {}),
        )
        extractor = self.model.q_net.features_extractor
        assert isinstance(extractor, PaperFeatures)
        freeze(extractor.convs, frozen)
        self.network: nn.Module = self.model.q_net

    def run(self, steps: int) -> int:
        """Go on for so many environment steps; learning begins after the warm-up."""
        before = self.model.num_timesteps
        self.model.learn(steps, reset_num_timesteps=False)
        return int(self.model.num_timesteps) - before

    def sample(self) -> ReplayBufferSamples:
        """Draw a batch of kept transitions."""
        assert self.model.replay_buffer is not None
        return self.model.replay_buffer.sample(self.model.batch_size)

    def update(self, batch: ReplayBufferSamples) -> None:
        """One gradient step of the double DQN, then the soft target.

        Raises:
            TypeError: the library's DQN as it is samples by itself.
        """
        if not isinstance(self.model, DoubleDQN):
            raise TypeError("update: needs the double DQN")
        self.model.learn_from(batch)
        polyak_update(self.model.q_net.parameters(), self.model.q_net_target.parameters(), self.model.tau)
