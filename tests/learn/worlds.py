"""A one-dimensional world, to test the learner without the simulator."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor
from torchrl.data import Binary, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from ship_trl.config.types import BackendName, Learn, Loss, Network, Precision
from ship_trl.fast.worlds import accelerator
from ship_trl.learn.algorithm import Setup
from ship_trl.learn.hooks import LearningHooks
from ship_trl.learn.network import Draw, DuelingNetwork

fast_setup = partial(Setup, accelerator=accelerator())


class Freezing(LearningHooks):
    """Freezes the first layers up to a share of the episodes, and adds nothing to the loss."""

    def __init__(self, layers: int = 2, until: float = 2.0) -> None:
        self.layers, self.until = layers, until

    def frozen_layers(self, progress: float) -> int:
        return self.layers if progress < self.until else 0


class Corridor(EnvBase):
    """Action 1 goes right, others left; 4 to the right is the goal, 4 to the left a collision."""

    def __init__(self, num_envs: int, limit: int = 12, encoders: Mapping[str, Draw] | None = None) -> None:
        super().__init__(batch_size=torch.Size([num_envs]))
        self.limit, self.encoders = limit, encoders or {}
        shape = self.batch_size
        flag = lambda: Binary(1, shape=(*shape, 1), dtype=torch.bool)  # noqa: E731
        self.observation_spec = Composite(
            state=Unbounded(shape=(*shape, 2)),
            dcpa=Unbounded(shape=(*shape, 1)),
            goal=flag(),
            collision=flag(),
            shape=shape,
        )
        for key, encode in self.encoders.items():
            example = encode(torch.zeros(1, 2))[0]
            make = Binary if example.dtype is torch.bool else Unbounded
            self.observation_spec[key] = make(shape=(*shape, *example.shape), dtype=example.dtype)
        self.action_spec = Categorical(3, shape=shape)
        self.reward_spec = Unbounded(shape=(*shape, 1))
        self.done_spec = Composite(done=flag(), terminated=flag(), truncated=flag(), shape=shape)

    def _set_seed(self, seed: int | None) -> None: ...

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDict:
        no = torch.zeros((*self.batch_size, 1), dtype=torch.bool)
        values = {"state": torch.zeros(*self.batch_size, 2), "dcpa": torch.zeros(*self.batch_size, 1)}
        values |= {name: no.clone() for name in ("goal", "collision", "done", "terminated", "truncated")}
        return self._encoded(values)

    def _encoded(self, values: dict[str, Tensor]) -> TensorDict:
        values |= {key: encode(values["state"]) for key, encode in self.encoders.items()}
        return TensorDict(values, batch_size=self.batch_size)

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        move = torch.where(tensordict["action"] == 1, 1.0, -1.0)
        state = tensordict["state"] + torch.stack((move, torch.ones_like(move)), -1)
        goal, collision = state[:, :1] >= 4, state[:, :1] <= -4
        terminated = goal | collision
        truncated = (state[:, 1:] >= self.limit) & ~terminated
        values = {"state": state, "dcpa": state[:, :1].abs(), "goal": goal, "collision": collision}
        values |= {"reward": goal.float() * 100 - collision.float() * 100 - 1.0}
        values |= {"done": terminated | truncated, "terminated": terminated, "truncated": truncated}
        return self._encoded(values)


class Bars:
    """Draws the position as a bar: [..., 2] to uint8 [..., 1, 84, 84]."""

    background = torch.zeros(1, 84, 84, dtype=torch.uint8)

    def __call__(self, state: Tensor) -> Tensor:
        place = ((state[..., 0] + 4) * 10).clamp(0, 80)
        bar = (torch.arange(84) - place[..., None]).abs() < 6
        frames = (bar.to(torch.uint8) * 255)[..., None, None, :].expand(*state.shape[:-1], 1, 84, 84)
        return frames.contiguous()


draw = Bars()
# The paper's layers with a quarter of the filters.
FEW = Network([[8, 8, 4], [16, 4, 2], [16, 3, 1], [50, 7, 1]], 50)


def corridor_setup(seed: int, learn: Learn, **others: Any) -> Setup:
    """Return the parts of an algorithm in a corridor; each seed has its own random streams."""
    weights, exploration, replay = (Generator().manual_seed(seed * 10 + k) for k in range(3))
    return fast_setup(DuelingNetwork(1, 3, weights, FEW), draw, 3, learn, exploration, replay, **others)


def schedule(**changes: Any) -> Learn:
    """Return hyperparameters of a short training."""
    values: dict[str, Any] = {
        "episodes": 30,
        "num_envs": 3,
        "gamma": 0.9,
        "lr": 1e-3,
        "lr_end": 1e-3,
        "batch_size": 8,
        "replay_size": 500,
        "warmup_steps": 30,
        "update_every": 4,
        "tau": 0.05,
        "loss": Loss["l2"],
        "huber_delta": 1.0,
        "backend": BackendName.auto,
        "precision": Precision["fp32"],
        "reward_scale": 0.01,
        "epsilon_start": 1.0,
        "epsilon_end": 0.01,
        "epsilon_fraction": 0.6,
        "evaluate_every": 10,
        "evaluate_episodes": 5,
        "jumpstart_draws": 0,
    }
    return Learn(**(values | changes))
