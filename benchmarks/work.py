"""The work that all learners do alike: the case, the schedule, and the sizes."""

from __future__ import annotations

from typing import Any

from omegaconf import OmegaConf

from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Learn

CASE = "4"
FRAME = (1, 84, 84)
# Short, because the warm-up is not timed, but enough to sample from.
WARMUP_STEPS = 256
# Environment steps in one call of a probe: a whole number of updates.
STEPS_PER_CALL = 64


def learn_config(**changes: Any) -> Learn:
    """Return the paper profile's hyperparameters with a small replay, a fixed epsilon, and no evaluation."""
    fixed = {
        "epsilon_start": 0.1,
        "epsilon_end": 0.1,
        "warmup_steps": WARMUP_STEPS,
        "replay_size": 5_000,
        "episodes": 10**9,
        "evaluate_every": 2 * 10**9,
    }
    paper = OmegaConf.load(conf_dir() / "learn" / "paper.yaml")
    learn: Any = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(Learn), paper, fixed | changes))
    return learn
