"""`python -m ship_trl study profile=quick`: trains all runs of the paper's figures and our controls."""

from __future__ import annotations

import json
import sys

from ship_trl.cli.errors import refusals
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.run.progress import format_duration
from ship_trl.run.stop import TerminatedError, raise_at_sigterm
from ship_trl.study.launch.launch import LOG, processes, run_jobs, write_jobs
from ship_trl.study.launch.mend import set_aside
from ship_trl.study.launch.progress import Display, say, seconds_per_run
from ship_trl.study.margins import margins
from ship_trl.study.plan.config import StudyConfig, to_study
from ship_trl.study.plan.jobs import Job, plan_jobs
from ship_trl.study.plan.manifest import run_config, write_plan
from ship_trl.study.records.tables import has_tables
from ship_trl.study.report.wandb_summary import REPORT, check_account, log_summary

HELP = """\
python -m ship_trl study: trains every run of figures 5 to 7 and 9, and our controls.

  python -m ship_trl study profile=quick
  python -m ship_trl study profile=smoke pairs=[high] seeds=2

Stopped and started again, it goes on where it was. Keys, with their values in conf/study.yaml:

  profile=NAME      smoke, quick or paper      seeds=N          how many
  first_seed=N      the first of them, 0      block=N          seeds that are run whole before others
  pairs=[NAME,..]   arms=[NAME,..]             reuse, controls  true or false
  output=FOLDER     outputs/<profile>_study    retries=N        of runs that end without a result
  processes=N       runs at once, of joblib
  launcher=NAME     joblib, slurm, slurm_local, ray_local, ray_cluster
  overrides=[..]    of every run, as overrides=[learn.episodes=1000]
  logger=NAME       csv, wandb, tensorboard or all
                    wandb.mode=offline|online wandb.project=NAME wandb.entity=NAME

The report follows: <output>/report/index.html.
"""


def main(arguments: list[str] | None = None) -> None:
    """Plan the runs, estimate their time, run what is missing, and write the report."""
    given = sys.argv[1:] if arguments is None else arguments
    if {"--help", "-h"} & set(given):
        sys.stdout.write(HELP)
        return
    try:
        raise_at_sigterm()
        with refusals():
            config = to_study(given)
            check_account(config)
            jobs = plan_jobs(config)
            if has_tables(config.folder):
                raise ConfigError(
                    f"output: {config.folder} holds a study's tables; allowed: another output=FOLDER, as "
                    f"python -m ship_trl keep --restore {config.folder} FOLDER makes of them"
                )
            # The report reads the margins, perhaps days from now: check them first.
            margins()
            write_plan(jobs, config)
            left = run_study(jobs, config)
            conclude(jobs, left, config)
    except KeyboardInterrupt:
        print_error("interrupted; the same command goes on where it was")
        sys.exit(130)
    except TerminatedError:
        # The child processes were told, and have ended.
        print_error("terminated; the same command goes on where it was")
        sys.exit(143)
    if left:
        print_error(
            f"{len(left)} of {len(jobs)} runs have no result ({left[0].name} ...); see {config.folder / LOG}"
        )
        sys.exit(1)


def run_study(jobs: list[Job], config: StudyConfig) -> list[Job]:
    """Run all missing jobs; returns those that have no result in the end."""
    write_jobs(jobs, config)
    for line in set_aside(jobs, config):
        say(line)
    with Display(jobs, config, run_config(config).learn.episodes) as display:
        missing = display.missing()
        if missing and config.launcher == "joblib":
            say(f"{len(missing)} of {len(jobs)} runs to do; how long that takes is measured first")
            try:
                seconds, how = seconds_per_run(jobs, config, display.episodes)
            except RuntimeError as error:
                raise ConfigError(f"overrides: {error}") from None
            at_once = processes(config)
            total = format_duration(len(missing) * seconds / at_once)
            say(f"{len(missing)} of {len(jobs)} runs to do, about {total}, {at_once} at once, by {how}")
        elif missing:
            say(f"{len(missing)} of {len(jobs)} runs to do, by {config.launcher}")
        return run_jobs(missing, config, display.show)


def conclude(jobs: list[Job], left: list[Job], config: StudyConfig) -> None:
    """Write the report of the finished runs, and say where everything lies."""
    from ship_trl.study.report.write import report

    if len(left) < len(jobs):
        report(config.folder, config.folder / REPORT)
        log_summary(config)
    say(json.dumps({"runs": len(jobs), "missing": len(left), "folder": str(config.folder)}))
