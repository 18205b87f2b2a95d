"""The work that all learners of the benchmark do alike: case, schedule, and how it is started."""

from __future__ import annotations

from typing import Any

from omegaconf import OmegaConf

from ship_trl.config.network import load_network
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Learn

CASE = "4"
FRAME = (1, 84, 84)
CONV_LAYERS = len(load_network().conv)
# Exploring and learning go on at this rate while the clock runs.
EPSILON = 0.1
# Enough to sample from, and short: it is not timed.
WARMUP = 256
REPLAY = 5_000
# Environment steps in one call of a probe: a whole number of updates.
CHUNK = 64


def learn_config(**changes: Any) -> Learn:
    """Return the paper profile's learner with a small replay, epsilon fixed, and no evaluation."""
    fixed = {
        "epsilon_start": EPSILON,
        "epsilon_end": EPSILON,
        "warmup_steps": WARMUP,
        "replay_size": REPLAY,
        "episodes": 10**9,
        "evaluate_every": 2 * 10**9,
    }
    values = OmegaConf.merge(
        OmegaConf.structured(Learn), OmegaConf.load(conf_dir() / "learn" / "paper.yaml"), fixed | changes
    )
    learn: Any = OmegaConf.to_object(values)
    return learn
