"""What a sweeper maximises, and the best values at the end of a sweep. No torch."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig
from yaml import YAMLError

from ship_trl.config.errors import ConfigError, one_line
from ship_trl.config.types import Objective
from ship_trl.files.curve import RunError
from ship_trl.files.record import RunRecord
from ship_trl.files.untrusted import read_yaml
from ship_trl.run.plan import Run

# File that Hydra's sweepers write.
RESULTS = "optimization_results.yaml"


def objective(run: Run, result: RunRecord) -> float:
    """Return the greedy return that the setting `objective` chooses."""
    if run.config.objective is Objective.best:
        return result.best.episode_return
    if run.config.objective is Objective.final:
        return result.final.episode_return
    try:
        greedy = result.greedy
    except RunError as error:
        raise ConfigError(
            f"objective: {run.folder}: {error}; allowed without a curve: objective=final, objective=best"
        ) from None
    explored = run.config.learn.epsilon_fraction * run.config.learn.episodes
    # Never empty, because a run ends with an evaluation.
    return float(greedy.returns[greedy.episode >= explored].mean())


class BestTrial(Callback):
    """Prints the best trial of a sweep, if the sweeper names one."""

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Print after the last trial."""
        path = Path(config.hydra.sweep.dir) / RESULTS
        try:
            found: Any = read_yaml(path)
            params, value = dict(found["best_params"]), float(found["best_value"])
        except (OSError, YAMLError, KeyError, TypeError, ValueError):
            # With several objectives there is no best trial.
            return
        words = " ".join(f"{key}={given}" for key, given in params.items())
        sys.stdout.write(one_line(f"best trial: {words}, {config.objective} {value:.1f}; {path}") + "\n")
