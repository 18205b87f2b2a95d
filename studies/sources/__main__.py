"""`python -m studies.sources run|report numbers|pixels`: which source is worth most to a target?

Each case is learned from scratch with a few seeds; each network is then carried to all other cases by a few
arms. Runs from scratch of the target's length are the baseline. `run` makes the runs that are missing, many
at once, and `report` judges which measure of similarity predicts gains. studies/sources/README.md has the
plan and what was found.
"""

from __future__ import annotations

from functools import partial

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number
from ship_trl.config.bounds import Positive
from studies.command import make_parsers
from studies.sources.plan import FOLDER, SETTINGS, plan_tasks


def main(arguments: list[str] | None = None) -> None:
    """Make the runs, or measure, judge, and write tables and a picture."""
    parser, report = make_parsers("sources", __doc__, FOLDER, SETTINGS)
    report.add_argument("setting", choices=SETTINGS, help="what networks see")
    add_number(report, "--processes", Positive, 2, "that measure similarity at once (default 2)")
    options = parser.parse_args(arguments)
    # torch and pandas take seconds to import.
    with refusals():
        if options.verb == "report":
            from studies.sources.report import report as judge_and_write

            judge_and_write(options)
            return
        from studies.lockstep import make_missing
        from studies.sources.runs import train

        setting, folder = SETTINGS[options.setting], FOLDER / options.setting
        work = partial(train, overrides=setting.overrides)
        make_missing(plan_tasks(setting), folder, work, options.processes, options.device)


if __name__ == "__main__":
    main()
