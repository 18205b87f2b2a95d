"""What each bundled algorithm reads: its own keys, and how it uses others'. No torch.

A line in `READS` gives an algorithm's module its settings, which are checked before torch is imported.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Any

from pydantic import Field

from ship_trl.config.bounds import MAX_COUNT, MAX_STEPS, Count, PositiveShare, Share
from ship_trl.config.checks import TRANSITION_BYTES, Reads, check_bytes
from ship_trl.config.errors import require
from ship_trl.config.paths import is_path
from ship_trl.config.schema import rule
from ship_trl.config.types import Learn, Margin

TEACHERS = "a safetensors file, a result folder, or pretrained:NAME"
TeacherName = Annotated[Any, rule(TEACHERS, lambda name: isinstance(name, str) and is_path(name))]


@dataclass
class DoubleDQN:
    """Double dueling DQN has no keys of its own; all are in `learn`."""


@dataclass
class NStep:
    """Double dueling DQN with targets of `steps` rewards."""

    steps: Annotated[int, Field(ge=1, le=MAX_STEPS)]


@dataclass
class PPO:
    """Proximal policy optimisation.

    An update makes `epochs` passes over `rollout_steps` steps of each of `learn.num_envs` environments. After
    `imitation_start`, a share of the episodes, it also imitates the best episode from each start.
    """

    rollout_steps: Annotated[int, Field(ge=2, le=MAX_COUNT)]
    epochs: Count
    minibatch_size: Count
    clip_epsilon: Annotated[float, Field(gt=0, le=1)]
    gae_lambda: Share
    entropy_coeff: Annotated[float, Field(ge=0, le=1)]
    critic_coeff: Annotated[float, Field(ge=0, le=1000)]
    max_grad_norm: Annotated[float, Field(gt=0)]
    imitation_coeff: Annotated[float, Field(ge=0, le=1000)]
    imitation_start: Share

    def check(self, learn: Learn) -> None:
        """Check that a rollout fits into memory, and holds a minibatch."""
        step_bytes = learn.num_envs * TRANSITION_BYTES
        check_bytes("algorithm.rollout_steps", self.rollout_steps, "steps", step_bytes)
        most = self.rollout_steps * learn.num_envs
        allowed = f"at most {most} (rollout_steps of learn.num_envs={learn.num_envs} environments)"
        require(self.minibatch_size <= most, "algorithm.minibatch_size", allowed, self.minibatch_size)


@dataclass
class Pupil:
    """Distillation of the network of a `teacher` (learn/pupil.py).

    `own_fraction` is the share of the episodes after which the pupil chooses all actions. The temperature is
    in scaled rewards. Of `candidates` states one is learned.
    """

    teacher: TeacherName
    own_fraction: PositiveShare
    temperature: Annotated[float, Field(gt=0)]
    huber_weight: Annotated[float, Field(ge=0, le=1000)]
    candidates: Annotated[int, Field(ge=1, le=100)]


READS = {
    "double_dqn": Reads(DoubleDQN, is_default=True),
    "n_step": Reads(NStep),
    "ppo": Reads(
        PPO,
        is_on_policy=True,
        batch_key="minibatch_size",
        ignored=(
            *("learn.batch_size", "learn.update_every", "learn.tau", "learn.loss", "learn.huber_delta"),
            *("learn.replay_size", "learn.warmup_steps"),
            *("learn.epsilon_start", "learn.epsilon_end", "learn.epsilon_fraction"),
        ),
        # Files of runs without imitation do not name its keys.
        unnamed_without={"imitation_coeff": ("imitation_coeff", "imitation_start")},
    ),
    "pupil": Reads(
        Pupil,
        is_distilled=True,
        ignored=("learn.loss", "learn.gamma", *(f"margin.{one.name}" for one in fields(Margin))),
    ),
}
