"""The batched TorchRL environment: N ships of one case, one action a second."""

from __future__ import annotations

import math
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from ship_trl.config import World
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import STATE_SIZE, STEP, advance, target_positions
from ship_trl.sim.geometry import angle_off_bow, closest_approach
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.reward import ROUNDING, step_reward


class ShipEnv(EnvBase):
    """Own ship heads for the goal without a target ship coming inside the safe distance.

    Observation: `state` float32 [N, 4] = x, y (m, east and north), heading (rad, counter-clockwise
    from east), step; with `from_pixels` also `pixels` uint8 [N, C, 84, 84]. The start is fixed by
    the case, so a reset draws no random number.
    Action: int64 [N], index into table 1.
    Reward: float32 [N, 1], raw (equation 4).
    End: `terminated` at the goal or on a collision (the collision wins in the same step),
    `truncated` at the step limit. `goal` and `collision` say which; `dcpa` is the least distance
    to any target ship so far in the episode (metres, infinite without target ships).

    The environment holds no state of its own: a step is a function of the tensordict given.
    """

    batch_locked = True

    def __init__(
        self,
        case: Case,
        world: World,
        num_envs: int = 1,
        *,
        from_pixels: bool = False,
        colour: bool = False,
        device: str | torch.device = "cpu",
    ) -> None:
        super().__init__(device=torch.device(device), batch_size=torch.Size([num_envs]))
        self.case, self.world = case, world
        tensor = lambda values: torch.tensor(values, dtype=torch.float32, device=self.device)  # noqa: E731
        self._actions = tensor(world.actions)
        self._goal = tensor(case.goal)
        self._ship_start = tensor([[s.x, s.y] for s in case.target_ships]).reshape(-1, 2)
        self._ship_velocity = tensor(
            [
                [s.speed * math.cos(math.radians(s.heading)), s.speed * math.sin(math.radians(s.heading))]
                for s in case.target_ships
            ]
        ).reshape(-1, 2)
        self._start = tensor([*case.start, math.radians(case.heading), 0.0])
        self.rasteriser = Rasteriser(case, world, colour=colour, device=self.device)
        self.from_pixels = from_pixels
        self._make_specs()

    def _make_specs(self) -> None:
        shape, device = self.batch_size, self.device
        flag = lambda: Binary(1, shape=(*shape, 1), dtype=torch.bool, device=device)  # noqa: E731
        observation: dict[str, Any] = {
            "state": Unbounded(shape=(*shape, STATE_SIZE), device=device),
            "dcpa": Unbounded(shape=(*shape, 1), device=device),
            "goal": flag(),
            "collision": flag(),
        }
        if self.from_pixels:
            observation["pixels"] = self.rasteriser.spec(shape)
        self.observation_spec = Composite(observation, shape=shape, device=device)
        self.state_spec = Composite(
            {key: observation[key].clone() for key in ("state", "dcpa")}, shape=shape, device=device
        )
        self.action_spec = Categorical(len(self.world.actions), shape=shape, device=device)
        self.reward_spec = Unbounded(shape=(*shape, 1), device=device)
        self.done_spec = Composite(
            {"done": flag(), "terminated": flag(), "truncated": flag()}, shape=shape, device=device
        )

    def _set_seed(self, seed: int | None) -> None:
        """Nothing in the world is random; there is no generator to seed."""

    def _observe(self, state: Tensor, dcpa: Tensor, goal: Tensor, collision: Tensor) -> dict[str, Tensor]:
        observation = {"state": state, "dcpa": dcpa, "goal": goal, "collision": collision}
        if self.from_pixels:
            observation["pixels"] = self.rasteriser(state)
        return observation

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDict:
        rows = (*self.batch_size, 1)
        state = self._start.expand(*self.batch_size, STATE_SIZE).clone()
        dcpa = torch.full(rows, math.inf, device=self.device)
        no = torch.zeros(rows, dtype=torch.bool, device=self.device)
        fresh = TensorDict(
            self._observe(state, dcpa, no, no.clone())
            | {"done": no.clone(), "terminated": no.clone(), "truncated": no.clone()},
            batch_size=self.batch_size,
            device=self.device,
        )
        mask = None if tensordict is None else tensordict.get("_reset", None)
        if mask is None or bool(mask.all()):
            return fresh
        assert tensordict is not None
        kept = tensordict.select(*fresh.keys(), strict=False)
        for key, value in fresh.items():
            rows_mask = mask.reshape(mask.shape[0], *[1] * (value.dim() - 1))
            fresh.set(key, torch.where(rows_mask, value, kept.get(key, value)))
        return fresh

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        before = tensordict["state"]
        after = advance(before, tensordict["action"], self._actions, self.world.dt)
        apart = closest_approach(
            self._targets(before) - before[:, None, :2], self._targets(after) - after[:, None, :2]
        )
        nearest = apart.amin(-1) if apart.shape[-1] else torch.full_like(before[:, 0], math.inf)
        distance = torch.linalg.vector_norm(self._goal - after[:, :2], dim=-1)
        collision = nearest < self.world.safe_distance
        goal = (distance <= self.world.goal_distance + ROUNDING) & ~collision
        off_bow = angle_off_bow(after[:, :2], after[:, 2], self._goal)
        reward = step_reward(self.world.reward, distance, off_bow, goal, collision)
        terminated = (goal | collision).unsqueeze(-1)
        truncated = (after[:, STEP] >= self.world.max_steps).unsqueeze(-1) & ~terminated
        dcpa = torch.minimum(tensordict["dcpa"], nearest.unsqueeze(-1))
        return TensorDict(
            self._observe(after, dcpa, goal.unsqueeze(-1), collision.unsqueeze(-1))
            | {
                "reward": reward.unsqueeze(-1),
                "done": terminated | truncated,
                "terminated": terminated,
                "truncated": truncated,
            },
            batch_size=self.batch_size,
            device=self.device,
        )

    def _targets(self, state: Tensor) -> Tensor:
        return target_positions(state, self._ship_start, self._ship_velocity, self.world.dt)

    def step_and_maybe_reset(self, tensordict: TensorDictBase) -> tuple[TensorDictBase, TensorDictBase]:
        """Step, then start the finished rows afresh.

        TorchRL's own runs `torch.where` over every row of every entry; rewriting only the rows
        that ended does the same for a tenth of the time once there are many environments.
        """
        tensordict = self.step(tensordict)
        following = self._step_mdp(tensordict)
        rows = following["done"].squeeze(-1).nonzero().squeeze(-1)
        if rows.numel():
            start = self._reset()
            for key, value in start.items():
                # A copy, because the finished step's own entries stay in `tensordict["next"]`.
                following.set(key, following.get(key).index_copy(0, rows, value[rows]))
        return tensordict, following
