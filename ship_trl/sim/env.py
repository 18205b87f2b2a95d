"""The batched TorchRL environment: N own ships, each in a case of a suite."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor
from torchrl.data import Binary, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from ship_trl.config.types import Margin, Network, World
from ship_trl.sim.cases import Case, Suite, suite_of
from ship_trl.sim.encounter import Track, Tracker
from ship_trl.sim.render import Drawing, Rasteriser
from ship_trl.sim.replay import with_replay
from ship_trl.sim.rules import rule_payment
from ship_trl.sim.starts import draw_scenes, make_starts
from ship_trl.sim.transition import Step, Transition
from ship_trl.sim.vector import Numbers, VectorObservation

# False in every row that an action is taken in: a row in which one of them is true begins a new episode.
FLAGS = ("goal", "collision", "done", "terminated", "truncated")


class Engine:
    """Makes what computes a world, here in torch and Python.

    `ship_trl.fast` has a faster one, which may round differently.
    """

    def step(self, transition: Transition) -> Step:
        """Make the step of a transition."""
        return transition

    def tracker(self, tracker: Tracker) -> Track:
        """Make what writes into states what has happened."""
        return tracker

    def numbers(self, observation: VectorObservation, device: torch.device) -> Numbers:
        """Make what observes states as numbers."""
        return observation

    def drawing(self, rasteriser: Rasteriser) -> Drawing:
        """Make the drawing of a rasteriser."""
        return rasteriser.reference

    def scenes(self, *arguments: Any) -> bool:
        """Draw random encounters, see `starts.draw_scenes`."""
        return draw_scenes(*arguments)


class ShipEnv(EnvBase):
    """Steer own ship to the goal, and keep every target ship outside the safe distance.

    Observation: `state` float32 [N, S]: the whole scene, see `sim.state`. `dcpa` float32 [N, 1]: least
    distance (m) to any target ship so far in the episode, infinite without target ships. `goal` and
    `collision` bool [N, 1]: how the episode ended.
    Optional: `pixels` uint8 [N, C, 84, 84], and one entry for each of `encoders`.
    Action: int64 [N], index into table 1. A step lasts `world.dt` seconds.
    Reward: float32 [N, 1], raw (equation 4).
    Episode end: `terminated` at the goal or on a collision, which takes precedence in the same step;
    `truncated` at the step limit, with `margin.timeout` `terminated` too.

    A reset draws initial states from the suite with the environment's own generator; one unperturbed case
    draws no numbers. The environment holds no other state: a step is a function of the tensordict that it is
    given. The rows of a batch may be different cases.

    Args:
        suite: what episodes begin with; a case is a suite of one.
        world: physics and reward.
        num_envs: number of own ships, N.
        from_pixels: whether to observe `pixels`.
        colour: whether the pixels are RGB (C = 3) instead of grey (C = 1).
        vector_time: time (s) whose way a ship's speed vector shows in the pixels; 0 draws none.
        encoders: maps each further observation key to a function from states [N, S] to features [N, F]; an
            `action_mask` is one, bool [N, A].
        device: where to simulate.
        generator: random generator of the initial states, on the CPU; by default one with a random seed, so
            that parallel workers differ until `set_seed`.
        starts: initial states [N, S] with which every reset begins the N rows, in place of drawn ones.
        engine: what steps, draws and begins episodes; by default torch and Python alone do.
        margin: what training pays in addition to the world's reward.
    """

    batch_locked = True

    def __init__(
        self,
        suite: Suite | Case,
        world: World,
        num_envs: int = 1,
        *,
        from_pixels: bool = False,
        colour: bool = False,
        vector_time: float = 0.0,
        encoders: Mapping[str, Callable[[Tensor], Tensor]] | None = None,
        device: str | torch.device = "cpu",
        generator: Generator | None = None,
        starts: Tensor | None = None,
        engine: Engine | None = None,
        margin: Margin | None = None,
    ) -> None:
        num_envs, engine = num_envs if starts is None else len(starts), engine or Engine()
        super().__init__(device=torch.device(device), batch_size=torch.Size([num_envs]))
        self.suite = suite_of(suite) if isinstance(suite, Case) else suite
        self.world = world
        self.generator = generator or Generator("cpu")
        if generator is None:
            self.generator.seed()
        self._starts, self._given = make_starts(self.suite, world, engine.scenes), starts
        step = engine.step(Transition(world, self.device))
        self._simulate = with_replay(step, self.suite, world, self.device)
        self._track = engine.tracker(Tracker(world, self.device))
        self._numbers = engine.numbers
        self._draws = partial(Rasteriser, world, device=self.device, drawing=engine.drawing)
        self.rasteriser = self._draws(colour=colour, vector_time=vector_time)
        self.from_pixels, self.margin = from_pixels, margin or Margin()
        self._encoders = dict(encoders or {})
        self._make_specs()
        first = self._observe(self.begun(self._starts.states[:1]))
        self._own_keys = {*first, "dcpa", *FLAGS, "action", "reward", "next"}
        # If all episodes begin alike, their first observation is computed once.
        self._first = first if self.suite.is_fixed and starts is None else None

    @property
    def case(self) -> Case:
        """The case of a suite of one, see `Suite.case`."""
        return self.suite.case

    def observer(self, network: Network, colour: bool | None = None) -> Rasteriser | Numbers:
        """Return what maps states to a network's input; `colour` is by default that of `pixels`."""
        if network.linear:
            return self._numbers(VectorObservation.of(network, self.world), self.device)
        own = self.rasteriser
        colour = own.channels == 3 if colour is None else colour
        if (colour, network.vector_time) == (own.channels == 3, own.vector_time):
            return own
        return self._draws(colour=colour, vector_time=network.vector_time)

    def _make_specs(self) -> None:
        """Set the specs of observation, state, action, reward and done."""
        shape, device = self.batch_size, self.device
        flag = lambda: Binary(1, shape=(*shape, 1), dtype=torch.bool, device=device)  # noqa: E731
        observation: dict[str, Any] = {
            "state": Unbounded(shape=(*shape, self._starts.states.shape[1]), device=device),
            "dcpa": Unbounded(shape=(*shape, 1), device=device),
            "goal": flag(),
            "collision": flag(),
        }
        if self.from_pixels:
            observation["pixels"] = self.rasteriser.spec(shape)
        for key, encode in self._encoders.items():
            example = encode(self._starts.states[:1].to(device))[0]
            make = Binary if example.dtype is torch.bool else Unbounded
            observation[key] = make(shape=(*shape, *example.shape), dtype=example.dtype, device=device)
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
        """Seed the generator of the initial states."""
        if seed is not None:
            self.generator.manual_seed(seed)

    def _observe(self, state: Tensor) -> dict[str, Tensor]:
        """Return what is observed of states [N, S] alone."""
        observation = {"state": state}
        if self.from_pixels:
            observation["pixels"] = self.rasteriser(state)
        return observation | {key: encode(state) for key, encode in self._encoders.items()}

    def _begin(self, rows: Tensor | None = None) -> dict[str, Tensor]:
        """Return what is observed at the start of episodes in these rows, int64 [N], or in all of them."""
        count = self.batch_size[0] if rows is None else len(rows)
        if self._first is not None:
            return {key: value.expand(count, *value.shape[1:]) for key, value in self._first.items()}
        if self._given is None:
            states = self._starts.sample(count, self.generator)
        else:
            states = self._given if rows is None else self._given[rows.cpu()]
        return self._observe(self.begun(states))

    def begun(self, states: Tensor) -> Tensor:
        """Return states [N, S] in which encounters that begin at once have begun."""
        states = states.to(self.device)
        return self._track(states, states)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDict:
        """Return the initial entries of all rows; in a partial reset TorchRL keeps the other rows."""
        count, device = self.batch_size[0], self.device
        entries = {key: value.clone() for key, value in self._begin().items()}
        entries["dcpa"] = torch.full((count, 1), math.inf, device=device)
        entries |= {key: torch.zeros((count, 1), dtype=torch.bool, device=device) for key in FLAGS}
        return TensorDict(entries, batch_size=self.batch_size, device=device)

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        """Take one action in each row; return observation, reward and done flags."""
        before = tensordict["state"]
        after = self._simulate(before, tensordict["action"])
        state = self._track(before, after.state)
        terminated = (after.goal | after.collision).unsqueeze(-1)
        truncated = after.truncated.unsqueeze(-1)
        distance, reward = after.min_distance.unsqueeze(-1), after.reward.unsqueeze(-1)
        if self.margin.penalty:
            width = max(self.margin.distance - self.world.safe_distance, 1e-6)
            near = ((self.margin.distance - distance) / width).clamp(0.0, 1.0)
            reward = reward - self.margin.penalty * near
        if self.margin.rules:
            paid = rule_payment(before, state, self.world)
            reward = reward + self.margin.rules * paid.unsqueeze(-1)
        if self.margin.collision:
            reward = reward - self.margin.collision * after.collision.unsqueeze(-1)
        if self.margin.timeout:
            reward = reward - self.margin.timeout * truncated
            terminated = terminated | truncated
        return TensorDict(
            self._observe(state)
            | {
                "dcpa": torch.minimum(tensordict["dcpa"], distance),
                "goal": after.goal.unsqueeze(-1),
                "collision": after.collision.unsqueeze(-1),
                "reward": reward,
                "done": terminated | truncated,
                "terminated": terminated,
                "truncated": truncated,
            },
            batch_size=self.batch_size,
            device=self.device,
        )

    def step_and_maybe_reset(self, tensordict: TensorDictBase) -> tuple[TensorDictBase, TensorDictBase]:
        """Take a step, then reset the rows whose episode has ended.

        Return the tensordict with `next`, and the tensordict to act on next, as in TorchRL. TorchRL's own
        method takes three times as long: it checks the result of `_step` again, and copies every row.
        """
        outcome = self._step(tensordict)
        tensordict.set("next", outcome)
        following = outcome.exclude("reward")
        for key in tensordict.keys():  # noqa: SIM118 (a TensorDict iterates over its rows)
            if key not in self._own_keys:
                following.set(key, tensordict.get(key))
        rows = outcome["done"].squeeze(-1).nonzero().squeeze(-1)
        if rows.numel():
            # New tensors: the final step's entries stay unchanged in `tensordict["next"]`.
            for key, initial in self._begin(rows).items():
                following.set(key, following.get(key).index_copy(0, rows, initial))
            following.set("dcpa", following.get("dcpa").index_fill(0, rows, math.inf))
            for key in FLAGS:
                following.set(key, torch.zeros_like(following.get(key)))
        return tensordict, following
