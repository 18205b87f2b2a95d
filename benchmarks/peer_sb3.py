"""Stable-Baselines3's DQN with the paper's conv layers; the library has no double or dueling one."""

from __future__ import annotations

from typing import Any

import gymnasium
import torch.nn.functional as F
from stable_baselines3 import DQN
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from benchmarks.peer_network import conv_layers
from ship_trl.config.types import Learn


class PaperFeatures(BaseFeaturesExtractor):
    """The four conv layers of section 3.5; the library scales the pixels."""

    def __init__(self, observation_space: gymnasium.spaces.Box) -> None:
        super().__init__(observation_space, features_dim=200)
        self.convs = conv_layers()

    def forward(self, observations: Tensor) -> Tensor:
        """Map float [B, C, 84, 84] to [B, 200]."""
        x = observations
        for conv in self.convs:
            x = F.relu(conv(x))
        return x.flatten(1)


class Sb3Loop:
    """The library's DQN, with the first `frozen` conv layers frozen.

    What `learn` leaves open keeps the library's default.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], learn: Learn, frozen: int = 0, device: str = "cpu"
    ) -> None:
        self.model = DQN(
            "CnnPolicy",
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
            policy_kwargs={"features_extractor_class": PaperFeatures, "net_arch": [200]},
            device=device,
            seed=0,
        )
        self.network: nn.Module = self.model.q_net
        extractor = self.model.q_net.features_extractor
        assert isinstance(extractor, PaperFeatures)
        extractor.convs[:frozen].requires_grad_(False)

    def run(self, steps: int) -> None:
        """Train for `steps` environment steps; learning begins after the warm-up."""
        self.model.learn(steps, reset_num_timesteps=False)

    def update(self) -> None:
        """Take one gradient step on a batch that the library draws; drawing is under 1 % of the time."""
        self.model.train(gradient_steps=1, batch_size=self.model.batch_size)
