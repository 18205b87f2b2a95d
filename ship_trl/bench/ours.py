"""Ours, put together as a run does. All that the benchmark calls of `ship_trl.learn` is called here."""

from __future__ import annotations

from collections.abc import Callable

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor

from ship_trl.bench.flops import Layer, layers_of
from ship_trl.bench.work import CASE, CHUNK, CONV_LAYERS, learn_config
from ship_trl.config.arm import Arm
from ship_trl.config.types import Learn
from ship_trl.learn.agent import Agent
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.train import Finished, train
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.transfer.layers import copy_layers

ARMS = ("scratch", *(f"FE{n}" for n in range(1, CONV_LAYERS + 1)), "FT3")


def new_network(seed: int = 0) -> DuelingNetwork:
    """Return the paper's network with weights of its own, for grey pictures and seven actions."""
    return DuelingNetwork(1, len(load_world().actions), Generator().manual_seed(seed))


def network_layers() -> list[Layer]:
    """Return the layers of the paper's network with their operations."""
    return layers_of(new_network())


def frozen_layers(arm: str) -> int:
    """How many conv layers an arm keeps fixed."""
    return Arm.parse(arm).frozen_layers


class Ours:
    """An environment, a learner and its replay, for one arm.

    Args:
        arm: scratch, FE1 to FE4 (n layers frozen) or FT3 (three layers copied).
        case: what is sailed; case 4 if None.
        learn: hyperparameters; those of the benchmark if None.
    """

    def __init__(self, arm: str = "scratch", case: Case | None = None, learn: Learn | None = None) -> None:
        world = load_world()
        self.case = case or load_case(CASE, world)
        self.learn = learn or learn_config()
        self.eval_env = ShipEnv(self.case, world, 1)
        self.num_actions = len(world.actions)
        self.network = new_network(0)
        # Time does not depend on what a source has learned; other random weights stand for it.
        copy_layers(self.network, new_network(1).state_dict(), Arm.parse(arm))
        draw = self.eval_env.rasteriser
        exploration, frozen = Generator().manual_seed(2), frozen_layers(arm)
        self.agent = Agent(self.network, draw, self.num_actions, self.learn, exploration, frozen)
        observed = self.agent.observation
        encoders = {observed: self.agent.encode} if observed != "state" else {}
        self.env = ShipEnv(self.case, world, self.learn.num_envs, encoders=encoders)
        self.replay = self.agent.replay(self.learn, Generator().manual_seed(3), torch.device("cpu"))

    @property
    def precision(self) -> str:
        """What the learner computes in: fp32 or bf16."""
        return "bf16" if self.agent.dtype is torch.bfloat16 else "fp32"

    def fill(self, steps: int) -> None:
        """Put at least so many transitions of random actions into the replay."""
        current = self.env.reset()
        generator = Generator().manual_seed(4)
        for _ in range(-(-steps // self.learn.num_envs)):
            action = torch.randint(self.num_actions, (self.learn.num_envs,), generator=generator)
            stepped, current = self.env.step_and_maybe_reset(current.set("action", action))
            self.replay.extend(stepped)

    def whole_loop(self, chunk: int = CHUNK) -> Callable[[], int]:
        """Start the training loop; each call goes on for at least `chunk` environment steps.

        The warm-up is over when this returns.
        """
        events = train(self.env, self.eval_env, self.agent, self.replay, self.learn)
        done = 0

        def run(least: int = chunk) -> int:
            nonlocal done
            before = done
            while done < before + least:
                event = next(events)
                if isinstance(event, Finished):
                    done = event.steps
            return done - before

        run(self.learn.warmup_steps)
        return run

    def sample(self, batch_size: int | None = None) -> TensorDictBase:
        """Draw a batch from the replay."""
        return self.replay.sample(batch_size or self.learn.batch_size)

    def update(self, batch: TensorDictBase) -> None:
        """One gradient step, and the soft target."""
        self.agent.update(batch)

    def states(self, count: int) -> Tensor:
        """States out of the replay: [count, 4]."""
        states: Tensor = self.sample(count)[self.agent.observation]
        return states

    def act(self, states: Tensor) -> Tensor:
        """Greedy actions: the network decides on every state."""
        self.agent.policy.epsilon = 0.0
        found = self.agent.policy(TensorDict({self.agent.observation: states}, [len(states)]))
        action: Tensor = found["action"]
        return action
