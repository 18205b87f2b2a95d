"""Print the best values at the end of a sweep, as overrides to continue with."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig
from yaml import YAMLError

from ship_trl.config.errors import one_line
from ship_trl.files.untrusted import read_yaml

# File that Hydra's sweepers write.
RESULTS = "optimization_results.yaml"


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
