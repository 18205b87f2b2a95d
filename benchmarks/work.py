"""The work that all learners do alike: the case, the schedule, and the sizes."""

from __future__ import annotations

import tempfile
from importlib.util import find_spec
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Learn
from ship_trl.grid.compose import compose_config
from ship_trl.run.plan import Run, make_run

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


def plan_run(arm: str = "scratch", overrides: tuple[str, ...] = ()) -> Run:
    """Plan a run of an arm to `CASE`, with the paper's hyperparameters but for the overrides.

    The weights that it copies are random, because what a source has learned does not change the time.
    """
    words = ["profile=paper", "source=3", f"target={CASE}", f"+arm={arm}", "learn.episodes=1000000"]
    words += [] if arm == "scratch" else ["source_weights=random"]
    return plan(*words, *overrides)


def plan(*overrides: str) -> Run:
    """Plan a run by its overrides, in a temporary folder."""
    folder = Path(tempfile.gettempdir()) / "ship_trl_benchmarks"
    words = [f"output={folder}", "learn.jumpstart_draws=0", *overrides]
    return make_run(compose_config(*words))


def require_peers() -> None:
    """Raise a ConfigError if Stable-Baselines3 is missing."""
    if find_spec("stable_baselines3") is None:
        raise ConfigError(
            "benchmarks: stable_baselines3 is missing; allowed: pip install -e '.[bench]' first"
        )


def learn_config(*overrides: str) -> Learn:
    """Return the hyperparameters that ship_trl and its peers are timed with."""
    return plan_run(overrides=OVERRIDES + overrides).config.learn
