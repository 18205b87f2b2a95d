"""`python -m studies.sources run|report numbers|pixels`: which source is worth most to a target?

Each case is learned from scratch with a few seeds; each network is then carried to all other cases by a few
arms. Runs from scratch of the target's length are the baseline. `run` makes the runs that are missing, many
at once, and `report` judges which measure of similarity predicts gains. studies/sources/README.md has the
plan and what was found.
"""

from __future__ import annotations

import os

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive
from studies.runs import add_run_options, make_missing
from studies.sources.plan import FOLDER, SETTINGS, plan_tasks


def main(arguments: list[str] | None = None) -> None:
    """Make the runs, or measure, judge, and write tables and a picture."""
    os.environ["MPLBACKEND"] = "agg"
    parser = make_parser("", f"{__doc__}\nWrites:\n    {FOLDER}/SETTING*.csv, SETTING.png and weights")
    parser.prog = "python -m studies.sources"
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="run|report")
    add_run_options(verbs.add_parser("run"), SETTINGS)
    report = verbs.add_parser("report")
    report.add_argument("setting", choices=SETTINGS, help="what networks see")
    add_number(report, "--processes", Positive, 2, "that measure similarity at once (default 2)")
    report.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(arguments)
    with refusals():
        if options.verb == "report":
            from studies.sources.report import report as judge_and_write

            judge_and_write(options)
            return
        # torch takes seconds to import.
        from studies.sources.runs import train

        setting = SETTINGS[options.setting]
        make_missing(plan_tasks(setting), setting, FOLDER / options.setting, train, options)


if __name__ == "__main__":
    main()
