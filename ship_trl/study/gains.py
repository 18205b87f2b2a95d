"""`python -m ship_trl.study.gains SCRATCH KNOWING`: what could be gained on each case.

Its output stands in conf/analysis.yaml. SCRATCH holds runs from scratch; KNOWING the same cases and seeds
sailed by networks that have learned their case and learn no more, on the same schedule of exploration
(docs/analysis-plan.md, rule 5).
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import yaml

from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.study.analysis.metrics import TIMES, measure
from ship_trl.study.records.record import BrokenRunError, Record, find_runs, read_run

# Of these it is how much better the knowing network is; of dips the whole of what scratch shows.
GAINED, WHOLE = ("area", "time", "asymptote", "early area", "start"), ("dip", "collision rise")
Runs = dict[tuple[str, int], Record]


def main(arguments: list[str] | None = None) -> None:
    """Print the gains by target case and metric, as YAML, and say of how many seeds they are."""
    parser = make_parser("gains", __doc__)
    parser.add_argument("scratch", type=Path, metavar="SCRATCH", help="folder of runs from scratch")
    parser.add_argument("knowing", type=Path, metavar="KNOWING", help="folder of runs that know their case")
    options = parser.parse_args(arguments)
    try:
        found = gains(read_runs(options.scratch), read_runs(options.knowing))
    except ConfigError as error:
        print_error(str(error))
        sys.exit(1)
    sys.stdout.write("".join(f"# case {case}: {count} seeds\n" for case, (count, _) in found.items()))
    sys.stdout.write(
        yaml.safe_dump({"gains": {case: gain for case, (_, gain) in found.items()}}, sort_keys=False)
    )


def read_runs(folder: Path) -> Runs:
    """Read the runs below a folder by target case and seed.

    Raises:
        ConfigError: there is none, one is not whole, or two are of one case and seed.
    """
    runs: Runs = {}
    for path, _ in find_runs(folder):
        try:
            run = read_run(path)
        except BrokenRunError as error:
            raise ConfigError(f"{path}: {error}") from None
        if (run.target, run.seed) in runs:
            other = runs[run.target, run.seed].folder
            raise ConfigError(f"{path}: of the same case and seed as {other}; one of each is needed")
        runs[run.target, run.seed] = run
    if not runs:
        raise ConfigError(f"{folder}: no finished run below it")
    return runs


def gains(scratch: Runs, knowing: Runs) -> dict[str, tuple[int, dict[str, float]]]:
    """Return for each target case how many seeds both have, and the mean gain by metric where above zero.

    Raises:
        ConfigError: they have no case and seed in common.
    """
    seeds = defaultdict(list)
    for case, seed in sorted(scratch.keys() & knowing.keys()):
        seeds[case].append((scratch[case, seed], knowing[case, seed]))
    if not seeds:
        raise ConfigError("SCRATCH and KNOWING have no case and seed in common")
    return {case: (len(pairs), gain(pairs)) for case, pairs in seeds.items()}


def gain(pairs: list[tuple[Record, Record]]) -> dict[str, float]:
    """Return what could be gained by metric, a mean over pairs of runs (from scratch, knowing)."""
    found = {}
    for metric in GAINED:
        better = np.mean([measure(knowing, metric) - measure(scratch, metric) for scratch, knowing in pairs])
        found[metric] = -better if metric in TIMES else better
    for metric in WHOLE:
        found[metric] = np.mean([measure(scratch, metric) for scratch, _ in pairs])
    rounded = {metric: round(float(value), 3) for metric, value in found.items()}
    return {metric: value for metric, value in rounded.items() if value > 0}


if __name__ == "__main__":
    main()
