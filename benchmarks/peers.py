"""Peers: a double dueling DQN in Stable-Baselines3, in TorchRL's usual way, and in PyTorch tuned for a CPU.

Each takes a Gymnasium environment and hyperparameters, and learns with its first `frozen` conv layers frozen.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from tensordict import TensorDictBase
from tensordict.nn import TensorDictSequential
from torch import Tensor, nn
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import EnvBase, GymWrapper
from torchrl.modules import EGreedyModule, QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from benchmarks.ours import CASE, FRAME, WARMUP_STEPS
from ship_trl.config.types import Learn
from ship_trl.gym import ShipCollisionEnv

Env = gymnasium.Env[Any, Any]


def conv_layers() -> nn.ModuleList:
    """Return the four conv layers of section 3.5: from 84x84 grey pixels to 200 features."""
    layers = [nn.Conv2d(1, 32, 8, stride=4), nn.Conv2d(32, 64, 4, stride=2)]
    return nn.ModuleList([*layers, nn.Conv2d(64, 64, 3), nn.Conv2d(64, 200, 7)])


def encode(convs: nn.ModuleList, x: Tensor) -> Tensor:
    """Map float [..., 1, 84, 84] to 200 features [..., 200]."""
    for conv in convs:
        x = F.relu(conv(x))
    return x.flatten(-3)


class DuelingHead(nn.Module):
    """From 200 features to Q-values: a shared layer, then value and advantage."""

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        self.shared = nn.Linear(200, 200)
        self.value = nn.Linear(200, 1)
        self.advantage = nn.Linear(200, num_actions)

    def forward(self, features: Tensor) -> Tensor:
        """Map float [..., 200] to [..., A]."""
        x = F.relu(self.shared(features))
        advantage = self.advantage(x)
        return self.value(x) + advantage - advantage.mean(-1, keepdim=True)


class PlainNetwork(nn.Module):
    """PyTorch's own layers in their own layout."""

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        self.convs = conv_layers()
        self.head = DuelingHead(num_actions)

    def forward(self, pixels: Tensor) -> Tensor:
        """Map uint8 [..., 1, 84, 84] or [..., 84, 84, 1] to float [..., A]."""
        # With one channel the two layouts are the same bytes.
        return self.head(encode(self.convs, pixels.reshape(*pixels.shape[:-3], *FRAME) / 255.0))


class TunedNetwork(nn.Module):
    """The same function, laid out for a CPU: channels last, and no convolution where a product will do.

    The first convolution reads 4x4 blocks of pixels as 16 channels (`to_blocks`). The last one covers its
    whole input, so it is a linear layer. The weights are those of `PlainNetwork` in another order.
    """

    places: ClassVar[int] = 21

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        convs = [nn.Conv2d(16, 32, 2), *conv_layers()[1:3]]
        self.convs = nn.ModuleList([*convs, nn.Linear(49 * 64, 200)])
        self.head = DuelingHead(num_actions)
        for conv in convs:
            conv.weight.data = conv.weight.data.contiguous(memory_format=torch.channels_last)

    def forward(self, blocks: Tensor) -> Tensor:
        """Map uint8 [B, 21, 21, 16] to float [B, A]."""
        # One pass converts to the type that the convolution computes in.
        x = blocks.to(torch.get_autocast_dtype("cpu") if torch.is_autocast_enabled("cpu") else torch.float32)
        x = (x * (1 / 255)).permute(0, 3, 1, 2)
        for conv in self.convs[:3]:
            x = F.relu_(conv(x))
        x = F.relu_(self.convs[3](x.permute(0, 2, 3, 1).flatten(1)))
        return self.head(x)


def to_blocks(pixels: Tensor) -> Tensor:
    """Move 4x4 blocks of pixels into channels: uint8 [..., 84, 84] to [..., 21, 21, 16]."""
    shape, places = pixels.shape[:-2], TunedNetwork.places
    split = pixels.reshape(*shape, places, 4, places, 4)
    return split.transpose(-3, -2).reshape(*shape, places, places, 16)


class PaperFeatures(BaseFeaturesExtractor):
    """The four conv layers of section 3.5; the library scales the pixels."""

    def __init__(self, observation_space: gymnasium.spaces.Box) -> None:
        super().__init__(observation_space, features_dim=200)
        self.convs = conv_layers()

    def forward(self, observations: Tensor) -> Tensor:
        """Map float [B, C, 84, 84] to [B, 200]."""
        return encode(self.convs, observations)


class Sb3Loop:
    """The library's DQN, with the first `frozen` conv layers frozen.

    What `learn` leaves open keeps the library's default.
    """

    def __init__(self, env: Env, learn: Learn, frozen: int = 0, device: str = "cpu") -> None:
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


class TorchRLLoop:
    """A double dueling DQN of the library's parts, with the first `frozen` conv layers frozen."""

    def __init__(self, env: Env, learn: Learn, frozen: int = 0) -> None:
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


class Batch(NamedTuple):
    """B transitions: pixels uint8 [B, 21, 21, 16] as the network takes them, the rest [B]."""

    pixels: Tensor
    action: Tensor
    reward: Tensor
    next_pixels: Tensor
    terminated: Tensor


def read_blocks(pixels: NDArray[np.uint8]) -> Tensor:
    """Return a picture of 84x84 in any shape as the network takes it."""
    return to_blocks(torch.from_numpy(pixels).reshape(FRAME[1:]))


class TunedLoop:
    """Act, step, store, and learn every few steps, with the first `frozen` conv layers frozen.

    `bf16` computes in bfloat16 by autocast and keeps the weights in float32.
    """

    def __init__(self, env: Env, learn: Learn, frozen: int = 0, bf16: bool = False) -> None:
        self.env, self.learn, self.bf16 = env, learn, bf16
        self.num_actions = int(env.action_space.n)  # type: ignore[attr-defined]
        self.network = TunedNetwork(self.num_actions)
        self.network.convs[:frozen].requires_grad_(False)
        self.target = copy.deepcopy(self.network).requires_grad_(False)
        pairs = zip(self.network.parameters(), self.target.parameters(), strict=True)
        learning = [(online, slow) for online, slow in pairs if online.requires_grad]
        self.online: list[Tensor] = [online.detach() for online, _ in learning]
        self.slow: list[Tensor] = [slow for _, slow in learning]
        self.optimiser = torch.optim.Adam([online for online, _ in learning], lr=learn.lr, fused=True)
        size, shape = learn.replay_size, (TunedNetwork.places, TunedNetwork.places, 16)
        self.replay = Batch(
            pixels=torch.zeros((size, *shape), dtype=torch.uint8),
            action=torch.zeros(size, dtype=torch.int64),
            reward=torch.zeros(size),
            next_pixels=torch.zeros((size, *shape), dtype=torch.uint8),
            terminated=torch.zeros(size),
        )
        self.random = np.random.default_rng(0)
        self.observation = read_blocks(env.reset(seed=0)[0])
        self.steps = 0

    def act(self) -> int:
        """Choose an action: a random one in the warm-up, then by epsilon-greedy."""
        is_warm = self.steps < self.learn.warmup_steps
        if is_warm or self.random.random() < self.learn.epsilon_end:
            return int(self.random.integers(self.num_actions))
        # In float32 even with bf16: for one picture, converting all weights costs more than it saves.
        with torch.inference_mode():
            return int(self.network(self.observation[None]).argmax(1))

    def sample(self) -> Batch:
        """Draw a batch of kept transitions, uniformly."""
        rows = torch.randint(min(self.steps, self.learn.replay_size), (self.learn.batch_size,))
        return Batch(*(values.index_select(0, rows) for values in self.replay))

    def loss(self, batch: Batch) -> Tensor:
        """Return the mean squared error to the double-DQN target."""
        with torch.no_grad():
            best = self.network(batch.next_pixels).argmax(1, keepdim=True)
            value = self.target(batch.next_pixels).gather(1, best).squeeze(1)
            wanted = batch.reward + self.learn.gamma * value * (1 - batch.terminated)
        value = self.network(batch.pixels).gather(1, batch.action[:, None]).squeeze(1)
        return F.mse_loss(value, wanted)

    def update(self, batch: Batch) -> None:
        """Take one gradient step, then move the target network."""
        with torch.autocast("cpu", torch.bfloat16, enabled=self.bf16):
            loss = self.loss(batch)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        torch._foreach_lerp_(self.slow, self.online, self.learn.tau)

    def run(self, steps: int) -> None:
        """Train for `steps` environment steps; learning begins after the warm-up."""
        for _ in range(steps):
            action = self.act()
            pixels, reward, terminated, truncated, _ = self.env.step(np.int64(action))
            following = read_blocks(pixels)
            row = self.steps % self.learn.replay_size
            kept: tuple[Any, ...] = (self.observation, action, reward, following, terminated)
            for values, value in zip(self.replay, kept, strict=True):
                values[row] = value
            self.observation = read_blocks(self.env.reset()[0]) if terminated or truncated else following
            is_warm = self.steps < self.learn.warmup_steps
            self.steps += 1
            if not is_warm and self.steps % self.learn.update_every == 0:
                self.update(self.sample())


Peer = Sb3Loop | TorchRLLoop | TunedLoop
SB3, TUNED_BF16 = "SB3 DQN as it is", "tuned PyTorch, bf16"
PEERS: dict[str, Callable[..., Peer]] = {
    SB3: Sb3Loop,
    "TorchRL's usual way": TorchRLLoop,
    "tuned PyTorch, fp32": TunedLoop,
    TUNED_BF16: partial(TunedLoop, bf16=True),
}


def make_peer(name: str, learn: Learn, **given: Any) -> Peer:
    """Make a peer and run it through its warm-up, so that its next step learns.

    It learns in ship_trl's Gymnasium environment. That is faster than the pygame one, and one step of either
    is about a hundredth of a step of the loop.
    """
    peer = PEERS[name](ShipCollisionEnv(CASE, reward_scale=learn.reward_scale), learn, **given)
    peer.run(WARMUP_STEPS)
    return peer
