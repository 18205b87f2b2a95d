"""`python -m ship_trl report FOLDER`: the report of a study, from its runs or their tables. No torch."""

from __future__ import annotations

from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError


def main(arguments: list[str] | None = None) -> None:
    """Read the runs, measure the claims, write tables, figures and page."""
    parser = make_parser("report", __doc__)
    parser.add_argument("folder", type=Path, help="of a study, as outputs/confirmatory, or of its tables")
    parser.add_argument("--output", type=Path, help="where the report goes; default: FOLDER/report")
    parser.add_argument(
        "--seeds", type=int, metavar="N", help="the first N seeds only, as in the look after them"
    )
    options = parser.parse_args(arguments)
    with refusals():
        if not options.folder.is_dir():
            raise ConfigError(f"folder: no folder {options.folder}; python -m ship_trl study makes one")
        from ship_trl.study.report.write import report

        output = options.output or options.folder / "report"
        if output.resolve() == options.folder.resolve():
            raise ConfigError(f"--output: {output} is the study's own folder; allowed: another one")
        report(options.folder, output, options.seeds)
