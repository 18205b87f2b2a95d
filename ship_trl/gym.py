"""The world for Gymnasium, one ship or many: `ShipCollision-v0`.

    import gymnasium
    name = "ship_trl.gym:ShipCollision-v0"
    env = gymnasium.make(name, case="traffic", config={"traffic": {"reacting": 0.5}, "world": {"dt": 0.5}})
    envs = gymnasium.make_vec(name, num_envs=64, vectorization_mode="vector_entry_point", case="4")

Gymnasium imports the module before the colon, which registers the name. After `import ship_trl.gym` the name
alone is enough.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import HumanRendering
from numpy.typing import NDArray
from torch import Generator

from ship_trl.config.bounds import Count, Seconds
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.schema import read_as
from ship_trl.config.types import Observation
from ship_trl.fast.draw import CompiledDrawing
from ship_trl.fast.observe import CompiledVector
from ship_trl.fast.step import CompiledStep
from ship_trl.fast.track import CompiledTracker
from ship_trl.fast.worlds import make_starts
from ship_trl.foreign.suites import load_changed
from ship_trl.sim import scene
from ship_trl.sim.encounter import Tracker
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.replay import Replay, with_replay
from ship_trl.sim.transition import Transition
from ship_trl.sim.vector import VectorObservation

ENV_ID = "ShipCollision-v0"
Pixels = NDArray[np.uint8]
# Pixels, channels last, or the numbers of a vector, float32.
Observations = NDArray[Any]
Flags = NDArray[np.bool_]
Infos = dict[str, Any]
LARGE_PICTURE = 600


class ShipCollisionVectorEnv(gymnasium.vector.VectorEnv[Observations, NDArray[np.int64], NDArray[Any]]):
    """N own ships in one case, each in its own episode and with its own random numbers.

    Observation: uint8 [N, 84, 84, C], C = 1 (grey) or 3 (`colour`); as a vector float32 [N, F], see
    `ship_trl.sim.vector`. Action: int64 [N], indices into table 1.
    Reward: float32 [N], raw (equation 4), times `reward_scale`. `infos` has `state` (the scenes, see
    `ship_trl.sim.state`), `goal`, `collision` and `least_distance` (m, infinite without target ships). An
    episode starts as the case does; seeds matter only for a suite, whose starts are drawn.

    It gives what Gymnasium's `SyncVectorEnv` of N single environments gives. By `autoreset_mode` an episode
    that ends

    - SAME_STEP: is reset in the same step. The first observation of the next one is returned. The last one
      is in `infos["final_obs"]` (objects [N], an observation or None) with `infos["final_info"]`, for the
      rows in `infos["_final_obs"]` (bool [N]).
    - NEXT_STEP: is reset by the next step, which ignores the action and has reward 0. Gymnasium's wrappers
      that change observations need it.
    - DISABLED: is reset by `reset(options={"reset_mask": rows})` alone, bool [N].

    Args:
        num_envs: N.
        case: name of a case or a suite, or the path of a case's YAML file. By default case 4: a ship that
            keeps its course collides. "traffic" draws another encounter for every episode.
        colour: pixels have three channels instead of one.
        reward_scale: factor of the reward; raw rewards reach 200.
        observation: "pixels" or "vector".
        vector_time: time (s) whose way a ship's speed vector shows in the pixels; 0 draws none.
        render_mode: "rgb_array" for the large picture, or None.
        max_episode_steps: where an episode is truncated, if that is before `world.max_steps`.
        autoreset_mode: see above.
        config: changes of conf/world and of a suite, see `ship_trl.foreign.suites.load_changed`.

    Raises:
        ConfigError: no such case, observation, render mode or mode, or a wrong limit, time or key.
        ValueError: num_envs is less than 1.
    """

    # Gymnasium declares it on the instance.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        case: str = "4",
        colour: bool = False,
        reward_scale: float = 1.0,
        observation: str = "pixels",
        vector_time: float = 0.0,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        config: Mapping[str, Any] | None = None,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs: must be at least 1, got {num_envs}")
        if render_mode not in (None, "rgb_array"):
            raise ConfigError(f"render_mode: must be None or rgb_array, got {render_mode!r:.40}")
        # TorchRL reads the attribute, Gymnasium's wrappers the metadata.
        self.autoreset_mode: AutoresetMode = read_as(AutoresetMode, autoreset_mode, key="autoreset_mode")
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        kind: Observation = read_as(Observation, observation, key="observation")
        ahead: float = read_as(Seconds, vector_time, key="vector_time")
        self.suite, self.world = load_changed(str(case), config)
        limit = self.world.max_steps
        if max_episode_steps is not None and max_episode_steps != -1:  # Gymnasium's word for no limit
            limit = min(limit, read_as(Count, max_episode_steps, key="max_episode_steps"))
        self._starts = make_starts(self.suite, self.world)
        # Compiled loops on arrays: through tensors the step of one ship takes five times as long.
        limited = replace(self.world, max_steps=limit)
        self._step = CompiledStep(Transition(limited))
        self._replay = with_replay(self._step, self.suite, self.world)
        self._track = CompiledTracker(Tracker(self.world)).into
        rasteriser = Rasteriser(self.world, colour=colour, vector_time=ahead)
        self._draw = CompiledDrawing(rasteriser)
        self._generators = [Generator() for _ in range(num_envs)]
        for generator in self._generators:
            generator.seed()
        self._scale, self.num_envs, self.render_mode = np.float32(reward_scale), num_envs, render_mode
        self._encode: CompiledVector | None = None
        self._shape = (scene.SIZE, scene.SIZE, rasteriser.channels)
        self.single_observation_space: spaces.Box = spaces.Box(0, 255, self._shape, np.uint8)
        if kind is Observation.vector:
            self._encode = CompiledVector(VectorObservation.of(load_network("vector"), limited))
            shape = (self._encode.size,)
            self.single_observation_space = spaces.Box(-np.inf, np.inf, shape, np.float32)
        self.single_action_space = spaces.Discrete(len(self.world.actions))
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        # States [N, S], where each episode began (the map for people stays still), least distances so far
        # (m), and rows whose episode has ended and is not reset yet.
        self._state = np.empty((num_envs, self._starts.states.shape[1]), np.float32)
        self._first_state, self._least_distance = self._state.copy(), np.empty(num_envs, np.float32)
        self._over: Flags = np.zeros(num_envs, np.bool_)
        self._begin(~self._over)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Reset all episodes, or those in `options["reset_mask"]`, bool [N].

        Row i begins with the scene of the single environment's seed `seed + i`, or `seed[i]`; where it is
        None, its random numbers go on.

        Raises:
            ValueError: seeds or mask are not one a row, the mask is empty, or a seed is not a whole number
                from 0 to 2**64 - 1.
        """
        count = self.num_envs
        rows = np.asarray((options or {}).get("reset_mask", np.ones(count, np.bool_)))
        if rows.shape != (count,) or rows.dtype != np.bool_ or not rows.any():
            got = f"{rows.dtype} {list(rows.shape)}"
            raise ValueError(f"reset_mask: must be bool [{count}] with at least one True, got {got}")
        first: Any = [None] * count if seed is None else seed
        is_number = isinstance(first, int | float | np.number)
        seeds = [first + row for row in range(count)] if is_number else list(first)
        if len(seeds) != count:
            raise ValueError(f"seed: must be one number or a list of {count}, got a list of {len(seeds)}")
        for generator, one in ((self._generators[row], seeds[row]) for row in rows.nonzero()[0]):
            if one is not None:
                if not (isinstance(one, int | np.integer) and 0 <= one < 2**64):
                    raise ValueError(f"seed: must be a whole number from 0 to 2**64 - 1, got {one!r:.40}")
                generator.manual_seed(int(one))
        self._begin(rows)
        self._over = self._over & ~rows
        infos = self._infos(*np.zeros((2, count), np.bool_))
        if not rows.all():
            infos |= {f"_{key}": rows.copy() for key in infos}
        return self._observe(self._state), infos

    def _begin(self, rows: Flags) -> None:
        """Begin an episode in some rows."""
        self._least_distance[rows] = np.inf
        if self.suite.is_fixed:  # drawing would add a twentieth to a step of 64 ships
            self._state[rows] = self._starts.states.numpy()
        else:
            drawn = [self._starts.sample(1, self._generators[row]) for row in rows.nonzero()[0]]
            self._state[rows] = torch.cat(drawn).numpy()
        begun = self._state[rows]
        self._track(begun, begun)
        self._state[rows] = begun
        self._first_state[rows] = self._state[rows]

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Observations, NDArray[np.float32], Flags, Flags, Infos]:
        """Advance every ship by one second: turn, then move.

        Raises:
            ValueError: `actions` are not of shape [N], no whole numbers, or out of range.
            ResetNeeded: the mode is DISABLED, and an episode that has ended was not reset.
        """
        mode, resets = self.autoreset_mode, self._over
        if mode is AutoresetMode.DISABLED and resets.any():
            raise ResetNeeded(f"episodes {resets.nonzero()[0].tolist()!s:.60} have ended; reset them first")
        reward, (goal, collision, truncated) = self._advance(np.asarray(actions))
        if mode is AutoresetMode.NEXT_STEP and resets.any():
            self._begin(resets)
            for values in (reward, goal, collision, truncated):
                values[resets] = 0
        terminated = goal | collision
        self._over = over = terminated | truncated
        ends: Infos = {}
        if mode is AutoresetMode.SAME_STEP and over.any():
            last = np.full(self.num_envs, None, object)
            for row, observation in zip(over.nonzero()[0], self._observe(self._state[over]), strict=True):
                last[row] = observation
            ends = {"final_obs": last, "final_info": self._infos(goal, collision)}
            ends |= {"_final_obs": over, "_final_info": over}
            self._begin(over)
            goal, collision = goal & ~over, collision & ~over
        infos = self._infos(goal, collision) | ends
        return self._observe(self._state), reward * self._scale, terminated, truncated, infos

    def _advance(self, given: NDArray[Any]) -> tuple[NDArray[np.float32], Flags]:
        """Advance by a step; return raw rewards [N], and goal, collision and truncated [3, N]."""
        count, last = self.num_envs, len(self.world.actions) - 1
        if given.shape != (count,) or given.dtype.kind not in "iu":
            got = f"of shape {(count,)}, got {given.dtype} {given.shape}"
            raise ValueError(f"actions: must be whole numbers from 0 to {last} {got}")
        if (wrong := given[(given < 0) | (given > last)]).size:
            raise ValueError(f"actions: must be whole numbers from 0 to {last}, got {wrong[0]}")
        chosen, after, flags = given.astype(np.int64), np.empty_like(self._state), np.empty((3, count), bool)
        reward, distance = np.empty((2, count), np.float32)
        state = self._state
        if isinstance(self._replay, Replay):
            state = self._replay.turn(torch.from_numpy(state)).numpy()
        self._step.step_into(state, chosen, after, reward, flags, distance)
        self._track(self._state, after)
        self._state, self._least_distance = after, np.minimum(self._least_distance, distance)
        return reward, flags

    def _observe(self, state: NDArray[np.float32]) -> Observations:
        """Return what the network sees in states [N, S]: uint8 [N, 84, 84, C], or float32 [N, F]."""
        if self._encode is not None:
            return self._encode.of_rows(state)
        *image, channels = self._shape
        pictures = np.empty((len(state), channels, math.prod(image)), np.uint8)
        self._draw.draw_into(state, pictures)
        return np.ascontiguousarray(pictures.swapaxes(1, 2)).reshape(len(state), *image, channels)

    def _infos(self, goal: Flags, collision: Flags) -> Infos:
        held = {"state": self._state.copy(), "least_distance": self._least_distance.copy()}
        return held | {"goal": goal, "collision": collision}

    def render(self) -> tuple[Pixels, ...] | None:
        """Draw the large picture of each row for people, uint8 [600, 600, 3]."""
        if self.render_mode is None:
            return None
        # Imported here: training needs no pygame.
        from ship_trl.view.painter import draw_scene
        from ship_trl.view.pen import to_array

        rows = zip(torch.from_numpy(self._state), torch.from_numpy(self._first_state), strict=True)
        return tuple(to_array(draw_scene(self.world, state, LARGE_PICTURE, start)) for state, start in rows)


class ShipCollisionEnv(gymnasium.Env[Observations, np.int64]):
    """One own ship in one case: `ShipCollisionVectorEnv` of one ship, with the same arguments.

    Observations, reward and `info` are those of its row. `gymnasium.make(..., render_mode="human")` shows
    each step in a window.
    """

    metadata = ShipCollisionVectorEnv.metadata

    def __init__(self, case: str = "4", **given: Any) -> None:
        self._ships = ShipCollisionVectorEnv(1, case, autoreset_mode=AutoresetMode.DISABLED, **given)
        self.render_mode = self._ships.render_mode
        self.observation_space = self._ships.single_observation_space
        self.action_space = self._ships.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start an episode."""
        super().reset(seed=seed)
        observation, infos = self._ships.reset(seed=seed)
        return observation[0], self._info(infos)

    def step(self, action: np.int64) -> tuple[Observations, float, bool, bool, Infos]:
        """Advance by one second: turn, then move.

        Raises:
            ValueError: the action is no whole number from 0 to 6.
            ResetNeeded: the episode has ended.
        """
        observation, reward, terminated, truncated, infos = self._ships.step(np.asarray(action)[None])
        return observation[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), self._info(infos)

    def _info(self, infos: Infos) -> Infos:
        return {key: value[0] if value.ndim > 1 else value[0].item() for key, value in infos.items()}

    def render(self) -> Pixels | None:
        """Draw the large picture, uint8 [600, 600, 3]."""
        if (pictures := self._ships.render()) is None:
            gymnasium.logger.warn("render() draws nothing without render_mode")
            return None
        return pictures[0]


def make_ship(render_mode: str | None = None, **given: Any) -> gymnasium.Env[Observations, np.int64]:
    """Make `ShipCollisionEnv`, in a window for "human": `gymnasium.make` adds it too, but warns each time."""
    is_shown = render_mode == "human"
    env = ShipCollisionEnv(render_mode="rgb_array" if is_shown else render_mode, **given)
    return HumanRendering(env) if is_shown else env


# Gymnasium reads it where a class has it.
vars(make_ship)["metadata"] = ShipCollisionEnv.metadata | {"render_modes": ["human", "rgb_array"]}
if ENV_ID not in gymnasium.registry:
    gymnasium.register(
        ENV_ID,
        entry_point="ship_trl.gym:make_ship",
        vector_entry_point="ship_trl.gym:ShipCollisionVectorEnv",
    )
