"""`python -m ship_trl report FOLDER`: write the report of a study, from its runs or their tables."""

from __future__ import annotations

from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError


def main(arguments: list[str] | None = None) -> None:
    """Read the runs, judge the claims, and write tables, figures and page."""
    parser = make_parser("report", __doc__)
    parser.add_argument("folder", type=Path, help="folder of a study or its tables, as outputs/confirmatory")
    parser.add_argument("--output", type=Path, help="folder of the report; default: FOLDER/report")
    parser.add_argument("--seeds", type=int, metavar="N", help="use the first N seeds, as at an earlier look")
    parser.add_argument(
        "--claims",
        type=Path,
        metavar="FILE",
        help="Python file that judges; default: the paper's, in a checkout",
    )
    options = parser.parse_args(arguments)
    with refusals():
        if not options.folder.is_dir():
            raise ConfigError(f"folder: no folder {options.folder}; python -m ship_trl study makes one")
        from ship_trl.study.claims import load_claims
        from ship_trl.study.report.write import report

        output = options.output or options.folder / "report"
        if output.resolve() == options.folder.resolve():
            raise ConfigError(f"--output: {output} is the study's own folder; allowed: another one")
        report(options.folder, output, options.seeds, load_claims(options.claims))
