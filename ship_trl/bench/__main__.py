"""`python -m ship_trl.bench`: what the pipeline costs, beside peers that do the same work."""

from __future__ import annotations

import argparse
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.types import bfloat16_allowed

PARTS = ("simulator", "replay", "update", "loop", "frozen", "memory", "cores", "startup", "growth")


def main(arguments: list[str] | None = None) -> None:
    """Run the parts and print their tables."""
    parser = make_parser("bench", __doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (default all)")
    parser.add_argument("--rounds", type=int, default=5, help="passes over the probes of a part (default 5)")
    parser.add_argument("--seconds", type=float, default=2.0, help="for one probe in one round (default 2)")
    parser.add_argument("--json", type=Path, help="write the machine and every probe there, a line each")
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(arguments)
    problem = refusal(options)
    if problem:
        print_error(problem)
        sys.exit(1)
    results = run(options)
    if options.json is not None:
        write(options.json, results)


def refusal(options: argparse.Namespace) -> str:
    """Say what is wrong with the options or missing, in one line; nothing if all is well."""
    for part in options.parts:
        if part not in PARTS:
            return f"bench: no part {part}; allowed: {', '.join(PARTS)}"
    if options.rounds < 1:
        return f"--rounds: must be at least 1, got {options.rounds}"
    if not options.seconds > 0:
        return f"--seconds: must be above 0, got {options.seconds}"
    if options.json is not None and not options.json.absolute().parent.is_dir():
        return f"--json: no folder {options.json.absolute().parent}"
    if find_spec("stable_baselines3") is None:
        return "bench: stable_baselines3 is missing; pip install 'ship_trl[bench]' brings it"
    try:
        bfloat16_allowed()
    except ConfigError as error:
        return str(error)
    return ""


def run(options: argparse.Namespace) -> list[Any]:
    """Time the machine, then the parts one after the other."""
    # After the checks: torch takes seconds to import.
    from ship_trl.bench import parts, report
    from ship_trl.bench.machine import survey
    from ship_trl.run.process import configure_process

    configure_process()
    machine = survey()
    report.header(machine)
    plan = parts.Plan(options.rounds, options.seconds, options.markdown, machine)
    results: list[Any] = [machine]
    for part in options.parts or PARTS:
        results += parts.run_part(part, plan)
    return results


def write(path: Path, results: list[Any]) -> None:
    """One line of JSON for each result."""
    from ship_trl.bench.report import json_line
    from ship_trl.files.disk import replacing

    with replacing(path) as draft:
        draft.write_text("".join(f"{json_line(result)}\n" for result in results))


if __name__ == "__main__":
    main()
