"""`python -m ship_trl`: one run, a grid of runs with `-m`, or a verb such as `watch`."""

from __future__ import annotations

import os
import sys
from importlib import import_module

from ship_trl.cli.help import HELP_FLAGS, VERBS, print_help


def main() -> None:
    """Run a verb, print the help, or train."""
    # No command opens a window of matplotlib, which refuses a notebook's backend where it is not installed.
    os.environ["MPLBACKEND"] = "agg"
    words = sys.argv[1:]
    if words and words[0] in VERBS:
        import_module(f"ship_trl.cli.{words[0]}").main(words[1:])
    elif HELP_FLAGS & set(words):
        print_help()
    else:
        train(words)


def train(words: list[str]) -> None:
    """Compose the configuration, check it, and only then import torch and run."""
    import hydra
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf import DictConfig

    from ship_trl.cli.errors import check_words, hydra_errors, job_errors, refusals
    from ship_trl.config.checks import ignored_keys, to_config
    from ship_trl.config.errors import print_error
    from ship_trl.config.paths import conf_dir
    from ship_trl.grid.callback import objective
    from ship_trl.grid.compose import use_loader
    from ship_trl.grid.launchers import GRID, LAUNCHER, die_with_launcher
    from ship_trl.run.plan import make_run
    from ship_trl.run.process import end_at_sigterm

    @hydra.main(config_path=str(conf_dir()), config_name="config", version_base="1.3")
    def entry(values: DictConfig) -> float:
        """Run, and return what a sweeper maximises."""
        die_with_launcher()
        with job_errors():
            config, hydra_config = to_config(values), HydraConfig.get()
            for key in ignored_keys(config.algorithm, hydra_config.overrides.task):
                print_error(f"{key}: not used by algorithm.build={config.algorithm['build']}")
            run = make_run(config)
            from ship_trl.run.experiment import run_experiment

            if hydra_config.mode is RunMode.MULTIRUN:
                place = f"{hydra_config.job.num + 1} of {os.environ.get(GRID, '?')}"
                result = run_experiment(run, place)
            else:
                # An algorithm of one's own may set each value itself.
                result = run_experiment(run, recipe=hydra_config.runtime.choices.get("recipe", ""))
            return objective(run, result)

    with refusals():
        check_words(words)
        use_loader()
    os.environ[LAUNCHER] = str(os.getpid())
    end_at_sigterm()
    with hydra_errors():
        entry()


if __name__ == "__main__":
    main()
