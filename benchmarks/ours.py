"""ship_trl's own learner, put together as in a run, so that its parts can be timed; and what peers share."""

from __future__ import annotations

import tempfile
from typing import cast

import torch
from tensordict import TensorDictBase
from torch import Generator

from ship_trl.config.types import Learn
from ship_trl.fast.worlds import make_env
from ship_trl.grid.compose import compose_config
from ship_trl.learn.double_dqn import DoubleDQN
from ship_trl.run.plan import Run, make_run
from ship_trl.run.setup import make_parts, read_source

ARMS = ("scratch", "FE1", "FE2", "FE3", "FE4", "FT3")
CASE = "4"
FRAME = (1, 84, 84)
# Short, because the warm-up is not timed, but enough to sample from.
WARMUP_STEPS = 256
# Environment steps in one call of a probe: a whole number of updates.
STEPS_PER_CALL = 64
# Epsilon stays the same while the clock runs, and nothing is evaluated.
OVERRIDES = (
    "learn.epsilon_start=0.1",
    "learn.epsilon_end=0.1",
    f"learn.warmup_steps={WARMUP_STEPS}",
    "learn.replay_size=5000",
    "learn.evaluate_every=1000000",
)


def plan(*overrides: str) -> Run:
    """Plan a run by its overrides, in a temporary folder."""
    words = [f"output={tempfile.gettempdir()}/ship_trl_benchmarks", "learn.jumpstart_draws=0", *overrides]
    return make_run(compose_config(*words))


def plan_run(arm: str = "scratch", overrides: tuple[str, ...] = ()) -> Run:
    """Plan a run of an arm to `CASE`, with the paper's hyperparameters but for the overrides.

    The weights that it copies are random, because what a source has learned does not change the time.
    """
    words = ["profile=paper", "source=3", f"target={CASE}", f"+arm={arm}", "learn.episodes=1000000"]
    words += [] if arm == "scratch" else ["source_weights=random"]
    return plan(*words, *overrides)


def learn_config(*overrides: str) -> Learn:
    """Return the hyperparameters that ship_trl and its peers are timed with."""
    return plan_run(overrides=OVERRIDES + overrides).config.learn


class Ours:
    """The parts of a run before its first step, and an environment to fill its replay.

    Args:
        run: what is trained; its folder is not written.
    """

    def __init__(self, run: Run) -> None:
        self.run, self.learn = run, run.config.learn
        self.parts = make_parts(run, torch.device(run.config.device), read_source(run))
        self.training = self.parts.training
        self.algorithm = cast(DoubleDQN, self.parts.algorithm)
        self.replay, encoders = self.algorithm.replay, self.algorithm.encoders
        self.env = make_env(
            run.target,
            run.config.world,
            self.learn.num_envs,
            encoders=encoders,
            device=run.config.device,
            generator=Generator().manual_seed(0),
        )

    def fill(self, steps: int) -> None:
        """Put at least `steps` transitions of random actions into the replay."""
        num_envs, num_actions = self.learn.num_envs, len(self.run.config.world.actions)
        current, generator = self.env.reset(), Generator().manual_seed(4)
        for _ in range(-(-steps // num_envs)):
            action = torch.randint(num_actions, (num_envs,), generator=generator)
            chosen = current.set("action", action.to(self.env.device))
            stepped, current = self.env.step_and_maybe_reset(chosen)
            self.replay.extend(stepped)

    def sample(self) -> TensorDictBase:
        """Draw a batch from the replay."""
        return self.algorithm.sample()

    def train(self, steps: int) -> None:
        """Train for at least `steps` environment steps."""
        end = self.training.steps + steps
        while self.training.steps < end:
            for _ in self.training.advance():
                pass


def make_ours(arm: str = "scratch", *overrides: str) -> Ours:
    """Put together what is timed beside peers."""
    return Ours(plan_run(arm, OVERRIDES + overrides))
