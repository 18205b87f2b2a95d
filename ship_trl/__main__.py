"""`python -m ship_trl`: one run, or with `-m` a grid of runs."""

from __future__ import annotations

import sys

from ship_trl.cli import HELP_FLAGS, hydra_errors, print_help
from ship_trl.paths import conf_dir


def main() -> None:
    """Answer --help at once; else compose, check, and only then import torch."""
    if HELP_FLAGS & set(sys.argv[1:]):
        print_help()
        return
    import hydra
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf import DictConfig

    from ship_trl.checks import to_config
    from ship_trl.cli import check_flags, job_errors, refusals
    from ship_trl.launchers import die_with_launcher, launches, place_in_grid
    from ship_trl.run.objective import objective
    from ship_trl.run.plan import make_run
    from ship_trl.stop import heed_sigterm

    @hydra.main(config_path=str(conf_dir()), config_name="config", version_base="1.3")
    def entry(values: DictConfig) -> float:
        """Run, and return what a sweeper maximises."""
        die_with_launcher()
        with job_errors():
            run = make_run(to_config(values))
            from ship_trl.run.experiment import run_experiment

            hydra_config = HydraConfig.get()
            many = hydra_config.mode is RunMode.MULTIRUN
            result = run_experiment(run, place_in_grid(hydra_config.job.num) if many else "")
            return objective(run, result)

    with refusals():
        check_flags(sys.argv[1:])
    launches()
    heed_sigterm()
    with hydra_errors():
        entry()


if __name__ == "__main__":
    main()
