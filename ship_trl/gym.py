"""The world for Gymnasium, one ship or many: `ShipCollision-v0`.

    import gymnasium
    name = "ship_trl.gym:ShipCollision-v0"
    env = gymnasium.make(name, case="4")
    envs = gymnasium.make_vec(name, num_envs=64, vectorization_mode="vector_entry_point", case="4")

Gymnasium imports the module before the colon, which registers the name. After `import ship_trl.gym` the name
alone is enough.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray
from torch import Generator

from ship_trl.config.bounds import Seconds
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.schema import read_as
from ship_trl.config.types import Observation
from ship_trl.fast.worlds import make_starts
from ship_trl.sim import scene
from ship_trl.sim.cases import load_world
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.state import first_case
from ship_trl.sim.suites import load_suite
from ship_trl.sim.transition import Transition
from ship_trl.sim.vector import VectorObservation

if TYPE_CHECKING:
    from ship_trl.fast.draw import CompiledDrawing
    from ship_trl.fast.step import CompiledStep

ENV_ID = "ShipCollision-v0"
Pixels = NDArray[np.uint8]
# Pixels, channels last, or the numbers of a vector, float32.
Observations = NDArray[Any]
Flags = NDArray[np.bool_]
Infos = dict[str, Any]
LARGE_PICTURE = 600
# Steps. States are float32, which holds whole numbers up to it.
NO_LIMIT = 2**24


class Ships:
    """N own ships of one case, each in its own episode and with its own random numbers.

    `state` is float32 [N, S], `dcpa` float32 [N] the least distance so far. The arguments are those of
    `ShipCollisionEnv`; a `max_steps` of None is the world's, -1 is no limit.

    Raises:
        ConfigError: no such case or observation, or a wrong limit or time.
    """

    def __init__(
        self,
        count: int,
        case: str,
        colour: bool,
        fast: bool,
        observation: str,
        vector_time: float,
        max_steps: int | None,
    ) -> None:
        kind: Observation = read_as(Observation, observation, key="observation")
        ahead: float = read_as(Seconds, vector_time, key="vector_time")
        self.world = load_world()
        limit = self.world.max_steps if max_steps is None else NO_LIMIT if max_steps == -1 else max_steps
        if not (isinstance(limit, int | np.integer) and 1 <= limit <= NO_LIMIT):
            allowed = f"a whole number from 1 to {NO_LIMIT}, or -1 for no limit"
            raise ConfigError(f"max_episode_steps: must be {allowed}, got {limit!r:.40}")
        self.suite = load_suite(str(case), self.world, "case")
        # The starts of random encounters must not depend on the limit.
        self._starts = make_starts(self.suite, self.world)
        self._transition = Transition(replace(self.world, max_steps=limit))
        self._rasteriser = Rasteriser(self.world, colour=colour, vector_time=ahead)
        # Compiled loops on arrays: through tensors the step of one ship takes five times as long.
        self._compiled: tuple[CompiledStep, CompiledDrawing] | None = None
        if fast:
            # Imported here: without compiled loops nothing needs numba.
            from ship_trl.fast.draw import CompiledDrawing
            from ship_trl.fast.step import CompiledStep

            self._compiled = CompiledStep(self._transition), CompiledDrawing(self._rasteriser)
        self._generators = [Generator() for _ in range(count)]
        for generator in self._generators:
            generator.seed()
        self._encode: VectorObservation | None = None
        self._shape = (scene.SIZE, scene.SIZE, self._rasteriser.channels)
        self.observation_space: spaces.Box = spaces.Box(0, 255, self._shape, np.uint8)
        if kind is Observation.vector:
            self._encode = VectorObservation(self.world, load_network("vector").ships)
            size = self._encode(self._starts.states[0]).numel()
            self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = spaces.Discrete(len(self.world.actions))
        self.state = np.empty((count, self._starts.states.shape[1]), np.float32)
        # Where each episode began: the map for people stays still.
        self._first_state = self.state.copy()
        self.dcpa = np.empty(count, np.float32)
        self.reset()

    def seed(self, seeds: Iterable[int | None]) -> None:
        """Seed the random numbers of each ship's starts; None goes on with those that it has.

        Raises:
            ValueError: a seed is not a whole number from 0 to 2**64 - 1.
        """
        for generator, seed in zip(self._generators, seeds, strict=True):
            if seed is not None:
                if not (isinstance(seed, int | np.integer) and 0 <= seed < 2**64):
                    raise ValueError(f"seed: must be a whole number from 0 to 2**64 - 1, got {seed!r:.40}")
                generator.manual_seed(int(seed))

    def reset(self, rows: Flags | slice = slice(None)) -> None:
        """Begin an episode in some rows, or in all."""
        self.dcpa[rows] = np.inf
        if self.suite.is_fixed:  # `draw` would add a twentieth to a step of 64 ships
            self.state[rows] = self._starts.states.numpy()
        else:
            drawn = np.arange(len(self.dcpa))[rows].tolist()
            self.state[rows] = np.concatenate([self._starts.draw(1, self._generators[row]) for row in drawn])
        self._first_state[rows] = self.state[rows]

    def advance(self, actions: object, shape: tuple[int, ...]) -> tuple[NDArray[np.float32], Flags]:
        """Advance by a step; return raw rewards [N], and goal, collision and truncated [3, N].

        Raises:
            ValueError: `actions` are not of the shape, no whole numbers, or out of range.
        """
        last, given = int(self.action_space.n) - 1, np.asarray(actions)
        if given.shape != shape or given.dtype.kind not in "iu":
            got = f"{given.dtype} {given.shape}"
            raise ValueError(f"actions: must be whole numbers from 0 to {last} of shape {shape}, got {got}")
        if (wrong := given[(given < 0) | (given > last)]).size:
            raise ValueError(f"actions: must be whole numbers from 0 to {last}, got {wrong[0]}")
        chosen, count = given.astype(np.int64).reshape(-1), len(self.state)
        after, flags = np.empty_like(self.state), np.empty((3, count), np.bool_)
        reward, distance = np.empty((2, count), np.float32)
        if self._compiled is not None:
            self._compiled[0].step_into(self.state, chosen, after, reward, flags, distance)
        else:
            told = self._transition(torch.from_numpy(self.state), torch.from_numpy(chosen))
            after[:], reward[:], distance[:] = told.state, told.reward, told.min_distance
            flags[:] = torch.stack((told.goal, told.collision, told.truncated))
        self.state, self.dcpa = after, np.minimum(self.dcpa, distance)
        return reward, flags

    def observe(self, state: NDArray[np.float32]) -> Observations:
        """Return what the network sees in states [N, S]: uint8 [N, 84, 84, C], or float32 [N, F]."""
        if self._encode is not None:
            with torch.inference_mode():  # a sixth faster
                return self._encode(torch.from_numpy(state)).numpy()
        *image, channels = self._shape
        pictures = np.empty((len(state), channels, math.prod(image)), np.uint8)
        if self._compiled is not None:
            self._compiled[1].draw_into(state, pictures)
        else:
            pictures[:] = self._rasteriser.reference(torch.from_numpy(state))
        return np.ascontiguousarray(pictures.swapaxes(1, 2)).reshape(len(state), *image, channels)

    def draw_large(self, row: int) -> Any:
        """Draw the scene of a row for people; return a pygame surface of 600 x 600 pixels."""
        # Imported here: training needs no pygame.
        from ship_trl.view.painter import draw_scene

        state, start = torch.from_numpy(self.state[row]), torch.from_numpy(self._first_state[row])
        return draw_scene(first_case(self.suite, state), self.world, state, LARGE_PICTURE, start)

    def picture(self, row: int) -> Pixels:
        """Draw the scene of a row for people: uint8 [600, 600, 3]."""
        from ship_trl.view.pen import to_array

        return to_array(self.draw_large(row))


def check_render_mode(mode: str | None, allowed: Sequence[str]) -> None:
    """Check the argument `render_mode`.

    Raises:
        ConfigError: it is no allowed mode.
    """
    if mode is not None and mode not in allowed:
        raise ConfigError(f"render_mode: must be None or one of {', '.join(allowed)}, got {mode!r:.40}")


class ShipCollisionEnv(gymnasium.Env[Observations, np.int64]):
    """One own ship in one case.

    Observation: uint8 [84, 84, C], C = 1 (grey) or 3 (`colour`); as a vector float32 [F], see
    `ship_trl.sim.vector`. Action: index into table 1.
    Reward: raw (equation 4), times `reward_scale`. `info` has `state` (the scene, see `ship_trl.sim.state`),
    `goal`, `collision` and `least_distance` (m, infinite without target ships). An episode starts as the case
    does; the seed matters only for a suite, whose starts are drawn.

    Args:
        case: name of a case or a suite, or the path of a case's YAML file.
        colour: pixels have three channels instead of one.
        reward_scale: factor of the reward; raw rewards reach 200.
        render_mode: "rgb_array" for the large picture, "human" for a window that shows each step, or None.
        fast: whether compiled loops step and draw; else torch does, which rounds differently.
        observation: "pixels" or "vector".
        vector_time: time (s) whose way a ship's speed vector shows in the pixels; 0 draws none.
        max_episode_steps: where an episode is truncated, by default after the world's 60; -1 for no limit.

    Raises:
        ConfigError: no such case, observation or render mode, or no screen.
    """

    # Gymnasium declares it on the instance.
    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        case: str = "1",
        colour: bool = False,
        reward_scale: float = 1.0,
        render_mode: str | None = None,
        fast: bool = True,
        observation: str = "pixels",
        vector_time: float = 0.0,
        max_episode_steps: int | None = None,
    ) -> None:
        check_render_mode(render_mode, self.metadata["render_modes"])
        self._ships = Ships(1, case, colour, fast, observation, vector_time, max_episode_steps)
        self._scale, self.render_mode = reward_scale, render_mode
        self._window, self._next_frame = ExitStack(), 0.0
        self.observation_space, self.action_space = self._ships.observation_space, self._ships.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start an episode."""
        super().reset(seed=seed)
        self._ships.seed([seed])
        self._ships.reset()
        return self._observe(goal=False, collision=False)

    def step(self, action: np.int64) -> tuple[Observations, float, bool, bool, Infos]:
        """Advance by one second: turn, then move.

        Raises:
            ValueError: the action is no whole number from 0 to 6.
        """
        reward, flags = self._ships.advance(action, ())
        goal, collision, truncated = flags[:, 0].tolist()
        observation, info = self._observe(goal, collision)
        return observation, float(reward[0]) * self._scale, goal or collision, truncated, info

    def _observe(self, goal: bool, collision: bool) -> tuple[Observations, Infos]:
        ships = self._ships
        if self.render_mode == "human":
            self._show()
        info = {"state": ships.state[0].copy(), "least_distance": float(ships.dcpa[0])}
        return ships.observe(ships.state)[0], info | {"goal": goal, "collision": collision}

    def render(self) -> Pixels | None:
        """Draw the large picture, uint8 [600, 600, 3]; a window shows each step by itself."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() draws nothing without render_mode")
        return self._ships.picture(0) if self.render_mode == "rgb_array" else None

    def _show(self) -> None:
        """Show the scene in the window, at most `render_fps` times a second."""
        # Imported here: training needs no pygame.
        import pygame

        from ship_trl.view.window import open_window

        if pygame.display.get_surface() is None:
            advice = "allowed without a screen: render_mode=rgb_array"
            self._window.enter_context(open_window((LARGE_PICTURE, LARGE_PICTURE), advice))
        window = pygame.display.get_surface()
        assert window is not None
        window.blit(self._ships.draw_large(0), (0, 0))
        # Without reading events the system takes the window for one that hangs.
        pygame.event.pump()
        pygame.display.flip()
        time.sleep(max(0.0, self._next_frame - time.monotonic()))
        self._next_frame = time.monotonic() + 1 / self.metadata["render_fps"]

    def close(self) -> None:
        """Close the window."""
        self._window.close()


class UnlimitedEnv(ShipCollisionEnv):
    """`ShipCollisionEnv` for `gymnasium.make`, whose `TimeLimit` truncates episodes in its place."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, max_episode_steps=-1)


class ShipCollisionVectorEnv(gymnasium.vector.VectorEnv[Observations, NDArray[np.int64], NDArray[Any]]):
    """N own ships in one case, each in its own episode; arguments and `infos` as in `ShipCollisionEnv`.

    Observation: uint8 [N, 84, 84, C] or float32 [N, F]. Action: int64 [N]. Reward: float32 [N]. It gives what
    Gymnasium's `SyncVectorEnv` of N single environments gives. By `autoreset_mode` an episode that ends

    - SAME_STEP: is reset in the same step. The first observation of the next one is returned. The last one
      is in `infos["final_obs"]` (objects [N], an observation or None) with `infos["final_info"]`, for the
      rows in `infos["_final_obs"]` (bool [N]).
    - NEXT_STEP: is reset by the next step, which ignores the action and has reward 0. Gymnasium's wrappers
      that change observations need it.
    - DISABLED: is reset by `reset(options={"reset_mask": rows})` alone, bool [N].

    Raises:
        ConfigError: no such case, observation, render mode or mode.
        ValueError: num_envs is less than 1.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        case: str = "1",
        colour: bool = False,
        reward_scale: float = 1.0,
        fast: bool = True,
        observation: str = "pixels",
        vector_time: float = 0.0,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs: must be at least 1, got {num_envs}")
        check_render_mode(render_mode, self.metadata["render_modes"])
        modes = [mode.value for mode in AutoresetMode]
        if autoreset_mode not in (*AutoresetMode, *modes):
            allowed = ", ".join(modes)
            raise ConfigError(f"autoreset_mode: must be one of {allowed}, got {autoreset_mode!r:.40}")
        # TorchRL reads the attribute, Gymnasium's wrappers the metadata.
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self._ships = Ships(num_envs, case, colour, fast, observation, vector_time, max_episode_steps)
        self._scale, self.num_envs, self.render_mode = np.float32(reward_scale), num_envs, render_mode
        self.single_observation_space: spaces.Box = self._ships.observation_space
        self.single_action_space = self._ships.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        # Rows whose episode has ended, and is not reset yet.
        self._over: Flags = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Reset all episodes, or those in `options["reset_mask"]`, bool [N].

        Row i begins with the scene of the single environment's seed `seed + i`, or `seed[i]`; where it is
        None, its random numbers go on. Seeds matter only for a suite, whose starts are drawn.

        Raises:
            ValueError: seeds or mask are not one a row, or the mask is empty.
        """
        ships, count = self._ships, self.num_envs
        rows = np.asarray((options or {}).get("reset_mask", np.ones(count, np.bool_)))
        if rows.shape != (count,) or rows.dtype != np.bool_ or not rows.any():
            got = f"{rows.dtype} {list(rows.shape)}"
            raise ValueError(f"reset_mask: must be bool [{count}] with at least one True, got {got}")
        first: Any = [None] * count if seed is None else seed
        is_number = isinstance(first, int | float | np.number)
        seeds = [first + row for row in range(count)] if is_number else list(first)
        if len(seeds) != count:
            raise ValueError(f"seed: must be one number or a list of {count}, got a list of {len(seeds)}")
        ships.seed(one if row else None for one, row in zip(seeds, rows, strict=True))
        ships.reset(rows)
        self._over = self._over & ~rows
        infos = self._infos(*np.zeros((2, count), np.bool_))
        if not rows.all():
            infos |= {f"_{key}": rows.copy() for key in infos}
        return ships.observe(ships.state), infos

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Observations, NDArray[np.float32], Flags, Flags, Infos]:
        """Advance every ship by one second: turn, then move.

        Raises:
            ValueError: `actions` is not one action per ship, or one is out of range.
            ResetNeeded: the mode is DISABLED, and an episode that has ended was not reset.
        """
        ships, mode, resets = self._ships, self.autoreset_mode, self._over
        if mode is AutoresetMode.DISABLED and resets.any():
            ended = resets.nonzero()[0].tolist()
            raise ResetNeeded(
                f"episodes {ended!s:.60} have ended; reset them by options={{'reset_mask': rows}}"
            )
        reward, (goal, collision, truncated) = ships.advance(actions, (self.num_envs,))
        if mode is AutoresetMode.NEXT_STEP and resets.any():
            ships.reset(resets)
            for values in (reward, goal, collision, truncated):
                values[resets] = 0
        terminated = goal | collision
        self._over = over = terminated | truncated
        ends: Infos = {}
        if mode is AutoresetMode.SAME_STEP and over.any():
            last = np.full(self.num_envs, None, object)
            for row, observation in zip(over.nonzero()[0], ships.observe(ships.state[over]), strict=True):
                last[row] = observation
            ends = {"final_obs": last, "final_info": self._infos(goal, collision)}
            ends |= {"_final_obs": over, "_final_info": over}
            ships.reset(over)
            goal, collision = goal & ~over, collision & ~over
        infos = self._infos(goal, collision) | ends
        return ships.observe(ships.state), reward * self._scale, terminated, truncated, infos

    def render(self) -> tuple[Pixels, ...] | None:
        """Draw the large picture of each row, uint8 [600, 600, 3]."""
        is_drawn = self.render_mode is not None
        return tuple(self._ships.picture(row) for row in range(self.num_envs)) if is_drawn else None

    def _infos(self, goal: Flags, collision: Flags) -> Infos:
        ships = self._ships
        ends = {"goal": goal, "collision": collision}
        return {"state": ships.state.copy(), "least_distance": ships.dcpa.copy(), **ends}


if ENV_ID not in gymnasium.registry:
    gymnasium.register(
        ENV_ID,
        entry_point="ship_trl.gym:UnlimitedEnv",
        vector_entry_point="ship_trl.gym:ShipCollisionVectorEnv",
        max_episode_steps=load_world().max_steps,
    )
