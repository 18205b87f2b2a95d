"""`python -m ship_trl study run|report|ask|keep|layers`: run a study, and read what it found.

    python -m ship_trl study run profile=quick                   train every run, and write the report
    python -m ship_trl study report FOLDER                       write it again, from runs or kept tables
    python -m ship_trl study ask FOLDER "low: FE3 above FE4"     estimate any contrast of arms
    python -m ship_trl study keep FOLDER COPY                    keep tables small enough to commit
    python -m ship_trl study layers FOLDER TABLE                 measure the similarity of layers (CKA)

Each has its own --help.
"""

from __future__ import annotations

import json
import math
import sys
from argparse import Namespace, RawDescriptionHelpFormatter
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError, command, counted, print_error
from ship_trl.config.paths import conf_dir
from ship_trl.run.console import say, show
from ship_trl.run.process import exit_at_sigterm
from ship_trl.study.claims import load_claims
from ship_trl.study.compare import ask
from ship_trl.study.launch import (
    LOG,
    REPORT,
    check_account,
    log_summary,
    processes,
    run_jobs,
    set_aside,
    show_progress,
    unfinished,
    write_jobs,
)
from ship_trl.study.manifest import run_config, write_plan
from ship_trl.study.plan import plan_jobs, to_study
from ship_trl.study.statistics import LEVEL, Estimate
from ship_trl.study.study import Study, finished_study
from ship_trl.study.tables import CURVES, RUNS, has_tables, restore, write_tables

RUN = f"""\
Train every run of a study, and write its report, <output>/report/index.html. Started again, an interrupted
study continues. Without words it is that of the paper's figures 5 to 7 and 9, with our controls. FILE.yaml,
and after it KEY=VALUE, set other values of these keys:

{(conf_dir() / "study.yaml").read_text()}"""
ASK = """\
Measure contrasts of a study's arms, such as

  every pair: FTW above scratch (early area)
  low: every arm sooner than scratch (time)
  lowest: mean of FT1, FT2 above mean of FE1, FE2
  low: FE4 above FE4 of 4 to 4
  low: FE4 (start)

An estimate is the interquartile mean over seeds of the difference within a seed, as in the report; for times,
how much sooner. Without a second arm it is the level of the first one. Intervals are at 95 %, unadjusted, and
decide no claim. A study under way shows the seeds of its last look, or the first --seeds.
"""
KEEP = """\
Copy what a study's report needs, small enough to commit. --restore makes a study's folder from its copy; the
study goes on from there, and does not train complete seeds again.
"""
HEADINGS = ("contrast", "estimate", "95 %", "seeds", "above zero", "beside")


def main(arguments: list[str] | None = None) -> None:
    """Read the words and do what they say."""
    parser = make_parser("study", __doc__)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="run|report|ask|keep|layers")
    run = verbs.add_parser("run", description=RUN, formatter_class=RawDescriptionHelpFormatter)
    run.add_argument("words", nargs="*", metavar="FILE.yaml|KEY=VALUE")
    report = verbs.add_parser("report", description="Write the report of a study, from its runs or tables.")
    report.add_argument("folder", type=Path, help="folder of a study or its tables, as outputs/confirmatory")
    report.add_argument("--output", type=Path, help="folder of the report; default: FOLDER/report")
    claims = "Python file that judges; default: the rules that the study was begun with"
    report.add_argument("--claims", type=Path, metavar="FILE", help=claims)
    ask = verbs.add_parser("ask", description=ASK, formatter_class=RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path, metavar="FOLDER", help="of a study, or of its kept tables")
    ask.add_argument("questions", nargs="+", metavar="QUESTION", help="WHERE: ARM above ARM (METRIC)")
    for one in (report, ask):
        one.add_argument("--seeds", type=int, metavar="N", help="the first N seeds only")
    keep = verbs.add_parser("keep", description=KEEP, formatter_class=RawDescriptionHelpFormatter)
    keep.add_argument("--restore", action="store_true", help="make a study's folder from a copy")
    keep.add_argument("origin", type=Path, metavar="FOLDER", help="of a study, as outputs/quick_study")
    keep.add_argument("goal", type=Path, metavar="COPY", help="of the tables; --restore swaps the two")
    layers = verbs.add_parser("layers", description="Measure the similarity of layers in a study's networks.")
    layers.add_argument("folder", type=Path, metavar="FOLDER", help="a study's, with its networks")
    layers.add_argument("table", type=Path, metavar="TABLE", help="a CSV to which missing seeds are added")
    found = parser.parse_args(arguments)
    if found.verb == "run":
        run_study(found.words)
        return
    with refusals():
        if found.verb == "layers":
            from ship_trl.explain.study import add_seeds

            add_seeds(found.folder, found.table)
            return
        {"report": write_report, "ask": print_answers, "keep": keep_tables}[found.verb](found)


def run_study(words: list[str]) -> None:
    """Plan the runs, run what is missing, and write the report."""
    exit_at_sigterm("terminated; the same command continues the study")
    with refusals("interrupted; the same command continues the study"):
        config = to_study(words)
        check_account(config)
        jobs = plan_jobs(config)
        if has_tables(config.folder):
            raise ConfigError(
                f"output: {config.folder} holds a study's tables; allowed: another output=FOLDER; "
                f"{command('study', 'keep', '--restore', config.folder, 'FOLDER')} makes one of them"
            )
        claims = load_claims()
        write_plan(jobs, config, claims.rules if {*claims.pairs} <= {*config.pairs} else ())
        write_jobs(jobs, config)
        for line in set_aside(jobs, config):
            say(line)
        missing = unfinished(jobs, config)
        by = f"{processes(config)} at once" if config.launcher == "joblib" else f"by {config.launcher}"
        say(f"{len(missing)} of {len(jobs)} runs to do, {by}")
        with show_progress(jobs, config, run_config(config).learn.episodes) as watch:
            left = run_jobs(missing, config, watch)
        if len(left) < len(jobs):
            from ship_trl.study.report.write import report

            report(config.folder, config.folder / REPORT)
            log_summary(config)
        say(json.dumps({"runs": len(jobs), "missing": len(left), "folder": str(config.folder)}))
    if left:
        print_error(
            f"{len(left)} of {len(jobs)} runs have no result ({left[0].name} ...); see {config.folder / LOG}"
        )
        sys.exit(1)


def write_report(options: Namespace) -> None:
    """Read the runs, judge the claims, and write tables, figures and page."""
    if not options.folder.is_dir():
        raise ConfigError(f"folder: no folder {options.folder}; python -m ship_trl study run makes one")
    from ship_trl.study.report.write import report

    output = options.output or options.folder / "report"
    if output.resolve() == options.folder.resolve():
        raise ConfigError(f"--output: {output} is the study's own folder; allowed: another one")
    report(options.folder, output, options.seeds, options.claims)


def print_answers(options: Namespace) -> None:
    """Print a row for each contrast."""
    study = finished_study(options.folder, options.seeds)
    show(HEADINGS, map(row, answers(study, options.questions, options.seeds)))


def answers(study: Study, questions: list[str], seeds: int | None = None) -> list[Estimate]:
    """Measure questions on the first `seeds` seeds, or on those of the last look.

    Contrasts of `every pair` and `every arm` with too few seeds are left out, and counted on stderr.
    """
    shown = study.first(study.whole_looks[-1] if seeds is None else seeds, LEVEL / 2)
    found = []
    for question in questions:
        contrasts = ask(shown, question)
        # A metric that a run has not measured is NaN.
        every = [contrast.measure(shown) for contrast in contrasts]
        measured = [one for one in every if one is not None and math.isfinite(one.value)]
        if not measured:
            raise ConfigError(f"question: {question!r} needs the metric of all its arms for two seeds")
        if few := len(contrasts) - len(measured):
            print_error(f"{question}: {few} of {len(contrasts)} contrasts lack two common seeds; left out")
        found += measured
    return found


def row(found: Estimate) -> list[str]:
    """Format a contrast, with the number of seeds above zero."""
    above = f"{sum(value > 0 for value in found.differences)} of {found.seeds}"
    beside = ", ".join(f"{name} {one.value:+.3f} ({one.interval()})" for name, one in found.beside.items())
    return [found.what, f"{found.value:+.3f}", found.interval(), str(found.seeds), above, beside]


def keep_tables(options: Namespace) -> None:
    """Copy a study and print the size of the copy, or restore it and print the seeds left to train."""
    origin, goal = options.origin, options.goal
    if options.restore:
        runs, others = restore(origin, goal)
        seeds = " ".join(map(str, others))
        left = f"; not complete, to be trained again: seeds {seeds}" if others else ""
        sys.stdout.write(f"{counted(runs, 'run')}{left}; {goal}\n")
        return
    whole, broken = write_tables(origin, goal)
    size = sum((goal / name).stat().st_size for name in (RUNS, CURVES))
    left = f", {broken} left out" if broken else ""
    sys.stdout.write(f"{counted(whole, 'run')}{left}; {size / whole / 1000:.1f} kB a run in {goal}\n")
