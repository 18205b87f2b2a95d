"""`python -m benchmarks curves`: how soon learners avoid random encounters, in minutes of one core.

ship_trl and Stable-Baselines3's DQN and PPO learn from the same numbers on suite `traffic_near`, one after
the other. Every half minute of training, their greedy policies meet the scenes of `traffic_test`. Minutes are
processor time, evaluations not counted. ship_trl trains as `target=traffic_near method=scratch
observation=vector learn.episodes=48000`, a schedule for few minutes; its profile adds a cost of near passes
to the reward. The others learn from the environment's reward until the minutes end, or 9.5 million steps, for
which SB3's DQN takes five to six minutes of a fast core.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import matplotlib
import numpy as np
import pandas as pd
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pydantic import Field
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv
from tensordict import TensorDictBase
from torch import Generator

from benchmarks.ours import Ours, plan
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Seed
from ship_trl.config.network import load_network
from ship_trl.config.schema import read_as
from ship_trl.config.types import Learn
from ship_trl.fast.worlds import make_env, make_starts
from ship_trl.files.disk import atomic_write
from ship_trl.gym import ShipCollisionVectorEnv
from ship_trl.learn.rollout import Policy, rollout
from ship_trl.run.console import show
from ship_trl.run.process import configure_process, processor_name
from ship_trl.sim.cases import load_suite, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.vector import VectorObservation
from ship_trl.view.style import CHART, CHART_DASHES, CHART_SERIES, MUTED, save_figure

# Minutes of a training, and between two evaluations.
TEST_SUITE, MINUTES, EVERY = "traffic_test", 10.0, 0.5
# Shares of test scenes solved that the table has the minutes of.
GOALS = (0.90, 0.95)
TABLE, PICTURE = Path("outputs/curves.csv"), Path("outputs/curves.png")
# Whole rollouts of PPO, of 64 steps of 512 ships.
STEPS = 290 * 64 * 512
# All ships at once: layers that see one ship at a time are ours.
LAYERS = [256, 256, 256]
RUN = ("target=traffic_near", "profile=traffic", "method=scratch", "observation=vector")
# A quarter of the profile's scenes. Chosen on seeds 100 and 101 of the same scenes.
SHORT = "learn.episodes=48000"
# Schedules of the teacher and its pupil in benchmarks/before.py, chosen on the same seeds.
TEACHER, PUPIL = "learn.episodes=96000", "learn.episodes=48000"
# For the reward of commit 53fcc0f, which had no costs of these; half of the profile's scenes.
SAME_REWARD = ("learn.episodes=104000", "margin.collision=0", "margin.timeout=0")
# Takes the greedy policy, the steps so far and whether training ends; returns whether to continue.
Record = Callable[[Policy, int, bool], bool]


class Curve:
    """The evaluations of one training, whose clock starts at the first `record`.

    `points` are minutes, environment steps, and the share of test scenes solved.
    """

    def __init__(self, learner: str, seed: int, minutes: float, env: ShipEnv) -> None:
        self.learner, self.seed, self._limit, self._env = learner, seed, minutes, env
        self.name = f"{learner}, seed {seed}"
        self.points: list[tuple[float, int, float]] = []
        self._began = 0.0

    def record(self, policy: Policy, steps: int, is_last: bool) -> bool:
        """Evaluate the policy if it is time to; return whether training goes on."""
        now = time.process_time()
        if not self.points:
            self._began = now
        minutes = (now - self._began) / 60
        ends = is_last or minutes >= self._limit
        if ends or minutes >= EVERY * len(self.points):
            episodes = rollout(self._env, policy)
            success = sum(one.goal for one in episodes) / len(episodes)
            self.points.append((minutes, steps, success))
            sys.stdout.write(f"{self.name}: {minutes:.1f} minutes, {steps:,} steps, {success:.1%}\n")
            self._began += time.process_time() - now
        return not ends

    def minutes_to(self, goal: float) -> float | None:
        """Return the minutes of the first evaluation at a goal or above; None if there is none."""
        return next((minutes for minutes, _, success in self.points if success >= goal), None)


def main(arguments: list[str]) -> None:
    """Train every learner with every seed, one after the other; write curves and picture, print a table."""
    parser = make_parser("", f"{__doc__}\n\nWrites:\n    {TABLE}, {PICTURE}")
    parser.prog = "python -m benchmarks curves"
    positive = Annotated[float, Field(gt=0)]
    add_number(parser, "--minutes", positive, MINUTES, f"of each training, at most (default {MINUTES:g})")
    read_seed = partial(read_as, Seed, key="--seeds")
    parser.add_argument("--seeds", nargs="+", type=read_seed, default=[0], metavar="N", help="default 0")
    options = parser.parse_args(arguments)
    configure_process()
    sys.stdout.write(f"{processor_name()}, torch {torch.__version__}, {torch.get_num_threads()} thread\n")
    world = load_world()
    suite = load_suite(TEST_SUITE, world)
    starts = make_starts(suite, world).balanced(len(suite.cases), Generator())
    env, curves = make_env(suite, world, starts=starts), list[Curve]()
    TABLE.parent.mkdir(exist_ok=True)
    for seed, (name, train) in product(options.seeds, LEARNERS.items()):
        curves.append(Curve(name, seed, options.minutes, env))
        train(seed, curves[-1].record)
        rows = [(one.learner, one.seed, *point) for one in curves for point in one.points]
        table = pd.DataFrame(rows, columns=["learner", "seed", "minutes", "steps", "success"])
        with atomic_write(TABLE) as draft:
            table.to_csv(draft, index=False)
        draw(PICTURE, curves)
    cells = []
    for curve in curves:
        found = [curve.minutes_to(goal) for goal in GOALS]
        _, steps, success = curve.points[-1]
        told = ["not reached" if one is None else f"{one:.1f}" for one in found]
        cells.append([curve.name, *told, f"{success:.1%}", f"{steps:,}"])
    show(("learner", *(f"minutes to {goal:.0%}" for goal in GOALS), "last", "steps"), cells)
    sys.stdout.write(f"{TABLE}\n{PICTURE}\n")


def train_ours(seed: int, record: Record) -> None:
    """Train as a run does, but without its own evaluations, until `record` returns False."""
    unevaluated = "learn.evaluate_every=1000000", "learn.evaluate_episodes=1"
    ours = Ours(plan(*RUN, SHORT, f"seed={seed}", *unevaluated))
    training, policy = ours.training, ours.algorithm.greedy
    while record(policy, training.steps, training.is_finished):
        for _ in training.advance():
            pass


@matplotlib.rc_context(CHART)
def draw(path: Path, curves: Sequence[Curve]) -> None:
    """Write a PNG of success over minutes, 1200 x 750: a colour a learner, a dash a seed."""
    figure = Figure(figsize=(12, 7.5), dpi=100)
    axes = figure.subplots()
    learners, seeds = ([*dict.fromkeys(getattr(one, key) for one in curves)] for key in ("learner", "seed"))
    for curve in curves:
        colour = CHART_SERIES[learners.index(curve.learner) % len(CHART_SERIES)]
        dash = CHART_DASHES[seeds.index(curve.seed) % len(CHART_DASHES)]
        minutes, _, success = zip(*curve.points, strict=True)
        axes.plot(minutes, success, color=colour, linestyle=dash, linewidth=2.2, label=curve.name)
    for goal in GOALS:
        axes.axhline(goal, color=MUTED, linewidth=1, linestyle=":")
    axes.set(ylim=(-0.02, 1.02), xlabel="minutes of one core", ylabel=f"share of {TEST_SUITE} solved")
    axes.set_title("Learning to avoid random encounters, seen as numbers", fontsize=15, loc="left")
    axes.margins(x=0.01)
    axes.legend(loc="lower right", fontsize=12, handlelength=3)
    save_figure(figure, path)


class ShipVecEnv(VecEnv):
    """The vector environment for Gymnasium, with the methods that Stable-Baselines3 calls."""

    def __init__(self, envs: ShipCollisionVectorEnv) -> None:
        self._envs, self._actions = envs, np.zeros(envs.num_envs, np.int64)
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> NDArray[Any]:
        """Begin all episodes; return observations [N, ...]."""
        observations, _ = self._envs.reset(seed=self._seeds[0])
        self._reset_seeds()
        return observations

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Keep the actions [N] for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step; return observations, rewards, ends of episodes [N], and a dict for each ship."""
        observations, rewards, terminated, truncated, infos = self._envs.step(self._actions)
        over, told = terminated | truncated, [dict[str, Any]() for _ in range(self.num_envs)]
        for row in over.nonzero()[0]:
            told[row] = {
                "terminal_observation": infos["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row]),
            }
        return observations, rewards, over, told

    def close(self) -> None:
        """Close the environment."""
        self._envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, the same for all ships."""
        return [getattr(self._envs, attr_name)] * self.num_envs

    def set_attr(self, *_: Any, **__: Any) -> Any:
        """Refuse: single ships have no attributes and methods."""
        raise NotImplementedError

    env_method = set_attr

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """Return that no ship is wrapped."""
        return [False] * self.num_envs


class Recorder(BaseCallback):
    """Calls `record` after every step, and ends the training when it says so."""

    def __init__(self, record: Record, policy: Policy) -> None:
        super().__init__()
        self._record, self._policy = record, policy

    def _on_step(self) -> bool:
        return self._record(self._policy, self.num_timesteps, self.num_timesteps >= STEPS)


def greedy_policy(model: BaseAlgorithm) -> Policy:
    """Return a model's greedy policy, which reads `state` [N, S] and writes `action` int64 [N]."""
    observe = VectorObservation.of(load_network("vector"), load_world())

    def act(step: TensorDictBase) -> TensorDictBase:
        action, _ = model.predict(observe(step["state"]).numpy(), deterministic=True)
        return step.set("action", torch.from_numpy(action))

    return act


def train_dqn(seed: int, record: Record) -> None:
    """Train DQN with the settings that were ours before its batches had 512 transitions."""
    learn = plan(*RUN).config.learn
    settings: dict[str, Any] = {
        "learning_rate": 5e-4,
        "buffer_size": learn.replay_size,
        "learning_starts": learn.warmup_steps,
        "batch_size": 128,
        "n_steps": 3,
        # After a step of all ships four updates; the target network follows as it would after each.
        "train_freq": 1,
        "gradient_steps": 4,
        "target_update_interval": learn.num_envs,
        "tau": 4 * 0.01,
        "exploration_fraction": 0.05,  # 0.5 million steps
        "exploration_final_eps": learn.epsilon_end,
    }
    train_peer(DQN, settings, learn, seed, record)


def train_ppo(seed: int, record: Record) -> None:
    """Train PPO with settings that the library's users would choose."""
    settings = {"learning_rate": 3e-4, "n_steps": 64, "batch_size": 512, "n_epochs": 10, "ent_coef": 0.01}
    train_peer(PPO, settings, plan(*RUN).config.learn, seed, record)


def train_peer(
    kind: Callable[..., BaseAlgorithm], settings: dict[str, Any], learn: Learn, seed: int, record: Record
) -> None:
    """Train a model on suite `traffic_near` for `STEPS` steps, or until `record` returns False."""
    made: dict[str, Any] = {"reward_scale": learn.reward_scale, "observation": "vector"}
    envs = ShipVecEnv(ShipCollisionVectorEnv(learn.num_envs, "traffic_near", **made))
    common: dict[str, Any] = {"gamma": learn.gamma, "policy_kwargs": {"net_arch": LAYERS}, "device": "cpu"}
    model = kind("MlpPolicy", envs, seed=seed, **common, **settings)
    model.learn(STEPS, Recorder(record, greedy_policy(model)))


LEARNERS = {"ours": train_ours, "SB3 DQN": train_dqn, "SB3 PPO": train_ppo}
