"""`python -m studies.second run|report [numbers|pixels|both]`: the second study.

`run` makes the runs that are missing, many at once; `report` judges contrasts, from the table of runs just
made or the one that was kept. studies/second/README.md has the questions and rules.
"""

from __future__ import annotations

from functools import partial

from ship_trl.cli.errors import refusals
from studies.command import make_parsers
from studies.second.plan import FOLDER, SETTINGS, SIZES, plan_tasks


def main(arguments: list[str] | None = None) -> None:
    """Make the runs, or judge, print, and write a table and a picture."""
    parser, report = make_parsers("second", __doc__, FOLDER, SETTINGS)
    what = "what networks see; both: question 5; default: one after the other"
    report.add_argument("setting", nargs="?", choices=(*SETTINGS, "both"), help=what)
    power = "how often question 1 finds a gain, simulated before the runs"
    report.add_argument("--power", action="store_true", help=power)
    options = parser.parse_args(arguments)
    # torch and pandas take seconds to import.
    with refusals():
        if options.verb == "report":
            from studies.second.report import report as judge_and_write

            judge_and_write(options)
            return
        from studies.lockstep import make_missing
        from studies.second.runs import learn_traffic, train

        overrides, folder = SETTINGS[options.setting].overrides, FOLDER / options.setting
        folder.mkdir(parents=True, exist_ok=True)
        if SIZES[options.setting].problem:
            learn_traffic(overrides, folder)
        work = partial(train, overrides=overrides)
        make_missing(plan_tasks(options.setting), folder, work, options.processes, options.device)


if __name__ == "__main__":
    main()
