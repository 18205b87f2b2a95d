"""`python -m ship_trl study profile=quick`: train all runs of the paper's figures and our controls."""

from __future__ import annotations

import json
import sys

from ship_trl.cli.errors import refusals
from ship_trl.cli.help import HELP_FLAGS
from ship_trl.config.command import command
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.run.console import format_duration
from ship_trl.run.process import TerminatedError, raise_at_sigterm
from ship_trl.study.claims import load_claims
from ship_trl.study.launch import (
    LOG,
    REPORT,
    Display,
    check_account,
    log_summary,
    processes,
    run_jobs,
    say,
    seconds_per_run,
    set_aside,
    unfinished,
    write_jobs,
)
from ship_trl.study.manifest import run_config, write_plan
from ship_trl.study.plan import Job, StudyConfig, plan_jobs, to_study
from ship_trl.study.tables import has_tables

HELP = """\
python -m ship_trl study: train every run of figures 5 to 7 and 9, and our controls.

  python -m ship_trl study profile=quick
  python -m ship_trl study profile=smoke pairs=[high] seeds=2

Started again, an interrupted study continues. Keys, with their values in conf/study.yaml:

  profile=NAME      smoke, quick, long, paper  seeds=N          how many
  first_seed=N      the first of them, 0      block=N          seeds that are run whole before others
  pairs=[NAME,..]   arms=[NAME,..]             reuse, controls  true or false
  output=FOLDER     outputs/<profile>_study    retries=N        of runs that end without a result
  processes=N       runs in parallel, of joblib
  launcher=NAME     joblib, slurm, slurm_local, ray_local, ray_cluster
  overrides=[..]    of every run, as overrides=[learn.episodes=1000]
  logger=NAME       csv, wandb, tensorboard or all
                    wandb.mode=offline|online wandb.project=NAME wandb.entity=NAME

The report follows: <output>/report/index.html.
"""


def main(arguments: list[str] | None = None) -> None:
    """Plan the runs, estimate their time, run what is missing, and write the report."""
    given = sys.argv[1:] if arguments is None else arguments
    if HELP_FLAGS & set(given):
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
                    f"output: {config.folder} holds a study's tables; allowed: another output=FOLDER; "
                    f"{command('keep', '--restore', config.folder, 'FOLDER')} makes one from the tables"
                )
            claims = load_claims()
            write_plan(jobs, config, claims.rules)
            left = run_study(jobs, config)
            if len(left) < len(jobs):
                from ship_trl.study.report.write import report

                report(config.folder, config.folder / REPORT, claims=claims)
                log_summary(config)
            say(json.dumps({"runs": len(jobs), "missing": len(left), "folder": str(config.folder)}))
    except KeyboardInterrupt:
        print_error("interrupted; the same command continues the study")
        sys.exit(130)
    except TerminatedError:
        # The child processes were told, and have ended.
        print_error("terminated; the same command continues the study")
        sys.exit(143)
    if left:
        print_error(
            f"{len(left)} of {len(jobs)} runs have no result ({left[0].name} ...); see {config.folder / LOG}"
        )
        sys.exit(1)


def run_study(jobs: list[Job], config: StudyConfig) -> list[Job]:
    """Run all missing jobs; return those that have no result in the end."""
    write_jobs(jobs, config)
    for line in set_aside(jobs, config):
        say(line)
    episodes = run_config(config).learn.episodes
    missing = unfinished(jobs, config)
    to_do = f"{len(missing)} of {len(jobs)} runs to do"
    if missing and config.launcher == "joblib":
        say(f"{to_do}; short runs measure how long they take")
        seconds, how = seconds_per_run(jobs, config, episodes)
        at_once = processes(config)
        duration = format_duration(len(missing) * seconds / at_once)
        say(f"{to_do}, about {duration}, {at_once} at once, by {how}")
    elif missing:
        say(f"{to_do}, by {config.launcher}")
    with Display(jobs, config, episodes) as display:
        return run_jobs(missing, config, display.show)
