"""`python -m studies.second run|report [numbers|pixels|both]`: the second study.

`run` makes the runs that are missing, many at once; `report` judges contrasts, from the table of runs just
made or the one that was kept. studies/second/README.md has the questions and rules.
"""

from __future__ import annotations

import os

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from studies.runs import add_run_options, make_missing
from studies.second.plan import FOLDER, SETTINGS, SIZES, plan_tasks


def main(arguments: list[str] | None = None) -> None:
    """Make the runs, or judge, print, and write a table and a picture."""
    os.environ["MPLBACKEND"] = "agg"
    parser = make_parser("", f"{__doc__}\nWrites:\n    {FOLDER}/SETTING*.csv, SETTING.png and weights")
    parser.prog = "python -m studies.second"
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="run|report")
    add_run_options(verbs.add_parser("run"), SETTINGS)
    report = verbs.add_parser("report")
    what = "what networks see; both: question 5; default: one after the other"
    report.add_argument("setting", nargs="?", choices=(*SETTINGS, "both"), help=what)
    power = "how often question 1 finds a gain, simulated before the runs"
    report.add_argument("--power", action="store_true", help=power)
    report.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(arguments)
    with refusals():
        if options.verb == "report":
            from studies.second.report import report as judge_and_write

            judge_and_write(options)
            return
        # torch takes seconds to import.
        from studies.second.runs import learn_traffic, train

        setting, sizes, folder = SETTINGS[options.setting], SIZES[options.setting], FOLDER / options.setting
        folder.mkdir(parents=True, exist_ok=True)
        if sizes.problem:
            learn_traffic(setting, folder)
        make_missing(plan_tasks(sizes), setting, folder, train, options)


if __name__ == "__main__":
    main()
