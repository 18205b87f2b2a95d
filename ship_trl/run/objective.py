"""The number of a finished run that a sweeper maximises. No torch."""

from __future__ import annotations

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Objective
from ship_trl.files.curve import CurveError, read_curve, split
from ship_trl.files.result import Result
from ship_trl.run.run import Run


def objective(run: Run, result: Result) -> float:
    """Return the greedy return that `objective` in the configuration chooses.

    Raises:
        ConfigError: it needs the curve, which is damaged.
    """
    if run.config.objective is Objective.best:
        return result.best.episode_return
    if run.config.objective is Objective.final:
        return result.final.episode_return
    try:
        _, greedy = split(read_curve(run.folder))
    except CurveError as error:
        raise ConfigError(
            f"objective: {run.folder}: {error}; allowed without it: objective=final or objective=best"
        ) from None
    explored = run.config.learn.epsilon_fraction * run.config.learn.episodes
    # A run ends with an evaluation, so there is always at least one.
    return float(greedy["return"][greedy["episode"] >= explored].mean())
