"""TorchRL's usual way: a collector, a replay of pixels in a tensor storage, DQNLoss, a soft target."""

from __future__ import annotations

from typing import Any

import gymnasium
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictSequential
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import EnvBase, GymWrapper
from torchrl.modules import EGreedyModule, QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from benchmarks.peer_network import PlainNetwork
from ship_trl.config.types import Learn


class TorchRLLoop:
    """A double dueling DQN of the library's parts, with the first `frozen` conv layers frozen."""

    def __init__(self, env: gymnasium.Env[Any, Any], learn: Learn, frozen: int = 0) -> None:
        self.learn = learn
        wrapped: EnvBase = GymWrapper(env, categorical_action_encoding=True)
        self.network = PlainNetwork(int(env.action_space.n))  # type: ignore[attr-defined]
        self.network.convs[:frozen].requires_grad_(False)
        actor = QValueActor(self.network, in_keys=["observation"], spec=wrapped.action_spec)
        explore = EGreedyModule(
            wrapped.action_spec,
            eps_init=learn.epsilon_start,
            eps_end=learn.epsilon_end,
            annealing_num_steps=1,
        )
        collector = Collector(
            wrapped,
            TensorDictSequential(actor, explore),
            frames_per_batch=learn.update_every,
            total_frames=-1,
            auto_register_policy_transforms=False,
            init_random_frames=learn.warmup_steps,
        )
        self.batches = iter(collector)
        self.replay = TensorDictReplayBuffer(
            storage=LazyTensorStorage(learn.replay_size), batch_size=learn.batch_size
        )
        self.loss_module = DQNLoss(actor, delay_value=True, double_dqn=True, loss_function="l2")
        self.loss_module.make_value_estimator(gamma=learn.gamma)
        trained = [p for p in self.network.parameters() if p.requires_grad]
        self.optimiser = torch.optim.Adam(trained, lr=learn.lr, fused=True)
        self.target = SoftUpdate(self.loss_module, tau=learn.tau)
        self.steps = 0

    def sample(self) -> TensorDictBase:
        """Draw a batch of kept transitions."""
        batch: TensorDictBase = self.replay.sample()
        return batch

    def update(self, batch: TensorDictBase) -> None:
        """Take one gradient step, then move the target network."""
        loss = self.loss_module(batch)["loss"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.target.step()

    def run(self, steps: int) -> None:
        """Train for `steps` environment steps, a multiple of `update_every`, learning after the warm-up."""
        for _ in range(steps // self.learn.update_every):
            self.replay.extend(next(self.batches))
            self.steps += self.learn.update_every
            if self.steps > self.learn.warmup_steps:
                self.update(self.sample())
