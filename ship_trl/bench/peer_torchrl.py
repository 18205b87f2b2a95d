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

from ship_trl.bench.peer_network import PlainNetwork, freeze
from ship_trl.config.types import Learn


class TorchRLLoop:
    """Double dueling DQN put together from the library's parts, as its tutorials do.

    Args:
        env: a Gymnasium environment of pictures [1, 84, 84].
        learn: hyperparameters.
        frozen: how many conv layers stay as they are.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], learn: Learn, frozen: int = 0) -> None:
        self.learn = learn
        wrapped: EnvBase = GymWrapper(env, categorical_action_encoding=True)
        self.network = PlainNetwork(int(env.action_space.n))  # type: ignore[attr-defined]
        freeze(self.network.convs, frozen)
        actor = QValueActor(self.network, in_keys=["observation"], spec=wrapped.action_spec)
        explore = EGreedyModule(
            wrapped.action_spec,
            eps_init=learn.epsilon_start,
            eps_end=learn.epsilon_end,
            annealing_num_steps=1,
        )
        self.collector = Collector(
            wrapped,
            TensorDictSequential(actor, explore),
            frames_per_batch=learn.update_every,
            total_frames=-1,
            auto_register_policy_transforms=False,
            init_random_frames=learn.warmup_steps,
        )
        self.batches = iter(self.collector)
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
        """One gradient step, then the soft target."""
        loss = self.loss_module(batch)["loss"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.target.step()

    def run(self, steps: int) -> int:
        """Go on for so many environment steps; learning begins after the warm-up."""
        for _ in range(steps // self.learn.update_every):
            self.replay.extend(next(self.batches))
            self.steps += self.learn.update_every
            if self.steps > self.learn.warmup_steps:
                self.update(self.sample())
        return steps // self.learn.update_every * self.learn.update_every
