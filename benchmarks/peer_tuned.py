"""A double dueling DQN in PyTorch alone, tuned for a CPU: blocks of pixels, channels last, fused steps."""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from benchmarks.peer_network import TunedNetwork, to_blocks
from benchmarks.work import FRAME
from ship_trl.config.types import Learn


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

    def __init__(
        self, env: gymnasium.Env[Any, Any], learn: Learn, frozen: int = 0, bf16: bool = False
    ) -> None:
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
