"""Training loops as people write them by hand around one Gymnasium environment."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.bench.peer_network import PlainNetwork, TunedNetwork, blocks, freeze
from ship_trl.bench.work import FRAME
from ship_trl.config.types import Learn


class Batch(NamedTuple):
    """Sampled transitions: pictures as the network takes them, the rest [B]."""

    pixels: Tensor
    action: Tensor
    reward: Tensor
    following: Tensor
    terminated: Tensor


class PixelLoop(ABC):
    """Double dueling DQN on one environment: act, step, store, and learn at every fourth step.

    Args:
        env: uint8 pictures of 84x84 in any shape; rewards already scaled.
        learn: hyperparameters.
        network: makes the Q-network for A actions; it has a list `convs`.
        frozen: how many conv layers stay as they are.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        learn: Learn,
        network: Callable[[int], PlainNetwork | TunedNetwork],
        frozen: int,
    ) -> None:
        self.env, self.learn = env, learn
        self.num_actions = int(env.action_space.n)  # type: ignore[attr-defined]
        self.network = network(self.num_actions)
        freeze(self.network.convs, frozen)
        self.target = copy.deepcopy(self.network).requires_grad_(False)
        self.trained = [p for p in self.network.parameters() if p.requires_grad]
        self.optimiser = torch.optim.Adam(self.trained, lr=learn.lr, fused=True)
        self.random = np.random.default_rng(0)
        self.observation, _ = env.reset(seed=0)
        self.steps = 0

    @abstractmethod
    def greedy(self, observation: NDArray[np.uint8]) -> int:
        """Choose the action that the network thinks best."""

    @abstractmethod
    def store(self, observation: Any, action: int, reward: float, following: Any, terminated: bool) -> None:
        """Keep a transition."""

    @abstractmethod
    def sample(self) -> Batch:
        """Draw a batch of kept transitions, uniformly."""

    def loss(self, batch: Batch) -> Tensor:
        """Mean squared error to the double-DQN target."""
        with torch.no_grad():
            best = self.network(batch.following).argmax(1, keepdim=True)
            value = self.target(batch.following).gather(1, best).squeeze(1)
            wanted = batch.reward + self.learn.gamma * value * (1 - batch.terminated)
        value = self.network(batch.pixels).gather(1, batch.action[:, None]).squeeze(1)
        return F.mse_loss(value, wanted)

    def update(self, batch: Batch) -> None:
        """One gradient step, then the soft target."""
        loss = self.loss(batch)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.follow()

    def follow(self) -> None:
        """Move the target a little towards the network."""
        with torch.no_grad():
            for slow, fast in zip(self.target.parameters(), self.network.parameters(), strict=True):
                slow.lerp_(fast, self.learn.tau)

    def run(self, steps: int) -> int:
        """Go on for so many environment steps; learning begins after the warm-up."""
        for _ in range(steps):
            warm = self.steps < self.learn.warmup_steps
            if warm or self.random.random() < self.learn.epsilon_end:
                action = int(self.random.integers(self.num_actions))
            else:
                action = self.greedy(self.observation)
            following, reward, terminated, truncated, _ = self.env.step(np.int64(action))
            self.store(self.observation, action, float(reward), following, terminated)
            self.observation = self.env.reset()[0] if terminated or truncated else following
            self.steps += 1
            if not warm and self.steps % self.learn.update_every == 0:
                self.update(self.sample())
        return steps


class PlainLoop(PixelLoop):
    """A single-file script: PyTorch's own layers, replay of uint8 pictures in NumPy."""

    def __init__(self, env: gymnasium.Env[Any, Any], learn: Learn, frozen: int = 0) -> None:
        super().__init__(env, learn, PlainNetwork, frozen)
        size = learn.replay_size
        self.pixels = np.zeros((size, *FRAME), np.uint8)
        self.following = np.zeros((size, *FRAME), np.uint8)
        self.action = np.zeros(size, np.int64)
        self.reward = np.zeros(size, np.float32)
        self.terminated = np.zeros(size, np.float32)
        self.count = 0

    def greedy(self, observation: NDArray[np.uint8]) -> int:
        """Choose the action that the network thinks best."""
        with torch.no_grad():
            return int(self.network(torch.as_tensor(observation).reshape(1, *FRAME)).argmax(1))

    def store(self, observation: Any, action: int, reward: float, following: Any, terminated: bool) -> None:
        """Keep a transition."""
        row = self.count % self.learn.replay_size
        self.pixels[row], self.following[row] = observation.reshape(FRAME), following.reshape(FRAME)
        self.action[row], self.reward[row], self.terminated[row] = action, reward, terminated
        self.count += 1

    def sample(self) -> Batch:
        """Draw a batch of kept transitions, uniformly."""
        rows = self.random.integers(min(self.count, self.learn.replay_size), size=self.learn.batch_size)
        arrays = (self.pixels, self.action, self.reward, self.following, self.terminated)
        return Batch(*(torch.from_numpy(array[rows]) for array in arrays))


class TunedLoop(PixelLoop):
    """The same by someone who knows the CPU: blocks and channels last, replay in torch, fused steps.

    Args:
        env: as above.
        learn: hyperparameters.
        frozen: how many conv layers stay as they are.
        bf16: compute in bfloat16 by autocast, keep weights in float32.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], learn: Learn, frozen: int = 0, bf16: bool = False
    ) -> None:
        super().__init__(env, learn, TunedNetwork, frozen)
        self.bf16 = bf16
        size, picture = learn.replay_size, (TunedNetwork.places, TunedNetwork.places, 16)
        self.kept = Batch(
            torch.zeros((size, *picture), dtype=torch.uint8),
            torch.zeros(size, dtype=torch.int64),
            torch.zeros(size),
            torch.zeros((size, *picture), dtype=torch.uint8),
            torch.zeros(size),
        )
        self.count = 0
        self.fast = [p.detach() for p in self.trained]
        both = zip(self.target.parameters(), self.network.parameters(), strict=True)
        self.slow: list[Tensor] = [slow for slow, fast in both if fast.requires_grad]

    def greedy(self, observation: NDArray[np.uint8]) -> int:
        """Choose the action that the network thinks best."""
        picture = blocks(torch.from_numpy(observation).reshape(1, *FRAME[1:]))
        # In float32 even with bf16: for one picture, converting all weights costs more than it saves.
        with torch.inference_mode():
            return int(self.network(picture).argmax(1))

    def store(self, observation: Any, action: int, reward: float, following: Any, terminated: bool) -> None:
        """Keep a transition."""
        row = self.count % self.learn.replay_size
        pictures = (torch.from_numpy(array).reshape(FRAME[1:]) for array in (observation, following))
        self.kept.pixels[row], self.kept.following[row] = map(blocks, pictures)
        self.kept.action[row], self.kept.reward[row] = action, reward
        self.kept.terminated[row] = float(terminated)
        self.count += 1

    def sample(self) -> Batch:
        """Draw a batch of kept transitions, uniformly."""
        rows = torch.randint(min(self.count, self.learn.replay_size), (self.learn.batch_size,))
        return Batch(*(values.index_select(0, rows) for values in self.kept))

    def loss(self, batch: Batch) -> Tensor:
        """Mean squared error to the double-DQN target."""
        with torch.autocast("cpu", torch.bfloat16, enabled=self.bf16):
            return super().loss(batch)

    def follow(self) -> None:
        """Move the target a little towards the network, all layers at once."""
        torch._foreach_lerp_(self.slow, self.fast, self.learn.tau)
