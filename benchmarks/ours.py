"""ship_trl's own learner, put together as a run does, so that its parts can be timed."""

from __future__ import annotations

from collections.abc import Callable

import torch
from tensordict import TensorDictBase
from torch import Generator

from benchmarks.work import CASE, STEPS_PER_CALL, learn_config
from ship_trl.config.types import Learn, World
from ship_trl.learn.agent import Agent
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.replay import StateReplay
from ship_trl.learn.train import Training
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.transfer.layers import Transfer, apply

ARMS = ("scratch", "FE1", "FE2", "FE3", "FE4", "FT3")


def frozen_layers(arm: str) -> int:
    """Return how many conv layers an arm freezes."""
    return int(arm[2:]) if arm.startswith("FE") else 0


def training_env(agent: Agent, case: Case, world: World, learn: Learn) -> ShipEnv:
    """Make the environment that an agent trains in, which writes the observations it learns from."""
    encoders = {agent.observation: agent.encode} if agent.observation != "state" else {}
    return ShipEnv(case, world, learn.num_envs, encoders=encoders)


def fill_replay(replay: StateReplay, env: ShipEnv, steps: int) -> None:
    """Put at least `steps` transitions of random actions into a replay."""
    num_envs, num_actions = env.batch_size[0], env.action_spec.space.n
    current, generator = env.reset(), Generator().manual_seed(4)
    for _ in range(-(-steps // num_envs)):
        action = torch.randint(num_actions, (num_envs,), generator=generator)
        stepped, current = env.step_and_maybe_reset(current.set("action", action))
        replay.extend(stepped)


def train_steps(training: Training, steps: int) -> None:
    """Train for at least `steps` environment steps."""
    end = training.steps + steps
    while training.steps < end:
        for _ in training.advance():
            pass


class Ours:
    """An environment, an agent and its replay for one arm on the benchmark's case.

    Args:
        arm: scratch, FE1 to FE4 (layers frozen) or FT1 to FT4 (layers copied).
        learn: hyperparameters; those of the benchmark if None.
    """

    def __init__(self, arm: str = "scratch", learn: Learn | None = None) -> None:
        world = load_world()
        case = load_case(CASE, world)
        self.learn = learn or learn_config()
        self.num_actions = len(world.actions)
        self.network = DuelingNetwork(1, self.num_actions, Generator().manual_seed(0))
        if arm != "scratch":
            # The weights do not change the time, so random ones stand for a trained source.
            source = DuelingNetwork(1, self.num_actions, Generator().manual_seed(1))
            apply(self.network, Transfer(source.state_dict(), int(arm[2:]), arm.startswith("FE")))
        self.eval_env = ShipEnv(case, world, 1)
        draw, exploration = self.eval_env.rasteriser, Generator().manual_seed(2)
        self.agent = Agent(self.network, draw, self.num_actions, self.learn, exploration)
        self.env = training_env(self.agent, case, world, self.learn)
        self.replay = self.agent.replay(self.learn, Generator().manual_seed(3), torch.device("cpu"))

    def fill(self, steps: int) -> None:
        """Put at least `steps` transitions of random actions into the replay."""
        fill_replay(self.replay, self.env, steps)

    def sample(self) -> TensorDictBase:
        """Draw a batch from the replay."""
        return self.replay.sample(self.learn.batch_size)

    def start_loop(self, steps: int = STEPS_PER_CALL) -> Callable[[], None]:
        """Train through the warm-up, and return a function that trains for `steps` more steps."""
        training = Training(self.env, self.eval_env, self.agent, self.replay, self.learn)
        training.begin()
        train_steps(training, self.learn.warmup_steps)
        return lambda: train_steps(training, steps)
