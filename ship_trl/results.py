"""`python -m ship_trl.results`: a table of the finished runs below a folder. No torch."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Column, Table

from ship_trl.cli import complain, make_parser
from ship_trl.plan import DAMAGED, RESULT, read_result

HEADINGS = (
    "run",
    "seeds",
    "best known",
    "best greedy return by seed",
    "share",
    "goal",
    "final by seed",
    "goal",
)
# Of a table that goes into a file or a pipe.
FILE_WIDTH = 200
TEST_HEADINGS = ("run", "mean greedy return of a run, one folder", "the other", "p, permutation")
KEYS = ("pair", "arm", "target", "seed", "best", "final", "best_known_return")


def main(arguments: list[str] | None = None) -> None:
    """Read the `result.json` of every run and print one row for each arm of a pair and folder."""
    parser = make_parser("ship_trl.results", __doc__)
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER", help="default: outputs")
    parser.add_argument("--arm", help="only this arm, as scratch or FT3")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    parser.add_argument("--picture", type=Path, help="draw the learning curves beside each other, as PNG")
    parser.add_argument("--test", action="store_true", help="test whether runs of two folders learn alike")
    parser.add_argument(
        "--stability", action="store_true", help="how often runs fall back, and how they spread"
    )
    parser.add_argument("--csv", type=Path, help="write every number of every run, a row each")
    options = parser.parse_args(arguments)
    folders = options.folders or [Path("outputs")]
    found: list[dict[str, Any]] = []
    for folder in folders:
        whole, broken = collect(folder)
        for path in broken:
            complain(f"{path} is not a whole result and is left out")
        found += [r | {"below": str(folder)} for r in whole if options.arm in (None, r["arm"])]
    if not found:
        places = ", ".join(map(str, folders))
        complain(f"folder: no finished run below {places}; python -m ship_trl makes one")
        sys.exit(1)
    rows = list(summarise(found))
    if options.picture is not None:
        picture(options.picture, found)
    if options.csv is not None:
        write_numbers(options.csv, grouped(found))
    show(HEADINGS, rows, options.markdown)
    if options.stability:
        from ship_trl.study.analysis import stability

        show(stability.HEADINGS, list(stability.rows(grouped(found))), options.markdown)
    if options.test:
        if len(folders) != 2:
            complain(f"--test: two folders are needed, got {len(folders)}")
            sys.exit(1)
        show(TEST_HEADINGS, list(compare(found, *map(str, folders))), options.markdown)


def write_numbers(path: Path, groups: dict[str, list[dict[str, Any]]]) -> None:
    """Write a row of numbers for each run, beside and renamed."""
    from ship_trl.study.analysis import stability
    from ship_trl.study.report import tables

    if not path.absolute().parent.is_dir():
        complain(f"--csv: no folder {path.absolute().parent}")
        sys.exit(1)
    tables.write_csv(path, list(stability.numbers(groups)))


def show(headings: tuple[str, ...], rows: list[list[str]], markdown: bool) -> None:
    """Print a table."""
    if markdown:
        lines = (headings, ["---"] * len(headings), *rows)
        sys.stdout.write("".join(f"| {' | '.join(row)} |\n" for row in lines) + "\n")
        return
    # What tells the rows apart is never cut, however narrow the terminal is.
    first = Column(headings[0], no_wrap=True, min_width=max(len(row[0]) for row in rows))
    table = Table(first, *headings[1:])
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = FILE_WIDTH
    console.print(table)


def collect(folder: Path) -> tuple[list[dict[str, Any]], list[Path]]:
    """Whole results below `folder`, in order, and the paths of those that are not whole.

    `part` of a result is where in `folder` its pair lies: a study has the same pair and arm in several parts.
    """
    found, broken = [], []
    for path in sorted(folder.rglob(RESULT)):
        if path.parent.name.startswith(DAMAGED):
            continue
        result = read_result(path.parent)
        if result is not None and all(key in result for key in KEYS):
            part = "/".join(path.relative_to(folder).parts[:-4])
            found.append(result | {"folder": path.parent, "part": part})
        else:
            broken.append(path)
    return found, broken


def grouped(results: Iterable[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Runs of each folder, part, profile, pair and arm, by the name of their row, in the order of seeds."""
    groups: dict[tuple[str, ...], list[dict[str, Any]]] = {}
    for result in results:
        names = (result["below"], result["part"], result.get("profile"), result["pair"], result["arm"])
        groups.setdefault(tuple(map(str, names)), []).append(result)
    several = len({below for below, *_ in groups}) > 1
    rows: dict[str, list[dict[str, Any]]] = {}
    for (below, part, _, pair, arm), runs in sorted(groups.items()):
        name = f"{place(part, pair)} {arm}"
        rows.setdefault(f"{below}: {name}" if several else name, []).extend(
            sorted(runs, key=lambda r: int(r["seed"]))
        )
    return rows


def summarise(results: Iterable[dict[str, Any]]) -> Iterable[list[str]]:
    """One row for each part, profile, pair and arm."""
    for name, runs in grouped(results).items():
        known = runs[0]["best_known_return"]
        best, final = ([r[which] for r in runs] for which in ("best", "final"))
        lowest = min(b["return"] for b in best)
        yield [
            name,
            " ".join(str(r["seed"]) for r in runs),
            f"{known:.1f}",
            " ".join(f"{b['return']:.1f}" for b in best),
            f"at least {lowest / known:.0%}" if known > 0 and lowest > 0 else "-",
            goals(best),
            " ".join(f"{f['return']:.1f}" for f in final),
            goals(final),
        ]


def read_curve(result: dict[str, Any]) -> tuple[list[float], list[int], list[float]] | None:
    """Training returns, and episodes and returns of greedy evaluations; says so where one is not whole."""
    try:
        with (result["folder"] / "curve.csv").open(newline="") as file:
            lines = list(csv.DictReader(file))
        greedy = [line for line in lines if line["greedy_return"]]
        return (
            [float(line["return"]) for line in lines if line["return"]],
            [int(line["episode"]) for line in greedy],
            [float(line["greedy_return"]) for line in greedy],
        )
    except (OSError, ValueError, KeyError):
        complain(f"{result['folder'] / 'curve.csv'} is not a whole learning curve and is left out")
        return None


def compare(results: list[dict[str, Any]], one: str, other: str) -> Iterable[list[str]]:
    """For each arm of a pair: the runs' mean greedy returns in both folders, and p of their being alike."""
    from ship_trl.study.analysis.statistics import permutation

    means: dict[tuple[str, str], dict[str, list[float]]] = {}
    for result in sorted(results, key=lambda r: int(r["seed"])):
        curve = read_curve(result)
        if curve is not None:
            name = place(result["part"], str(result["pair"])), str(result["arm"])
            by_folder = means.setdefault(name, {one: [], other: []})
            by_folder[result["below"]].append(float(np.mean(curve[2])))
    for (pair, arm), found in sorted(means.items()):
        samples = [np.array(found[folder]) for folder in (one, other)]
        enough = min(map(len, samples)) > 1
        p = f"{permutation(samples[0], samples[1], seed=0):.2f}" if enough else "-"
        yield [f"{pair} {arm}", *(" ".join(f"{mean:.1f}" for mean in sample) for sample in samples), p]


def picture(path: Path, results: list[dict[str, Any]]) -> None:
    """Draw learning curves: a column for each pair, a line for each arm and folder."""
    from ship_trl.view.comparison import Curve, draw_comparison

    several = len({r["below"] for r in results}) > 1
    panels: dict[str, dict[str, list[Curve]]] = {}
    for result in results:
        read = read_curve(result)
        if read is None:
            continue
        curve = Curve(*(np.array(values) for values in read))
        name = f"{result['below']}: {result['arm']}" if several else result["arm"]
        where = place(result["part"], str(result["pair"]))
        panels.setdefault(where, {}).setdefault(name, []).append(curve)
    if not panels:
        complain("picture: no learning curve to draw")
        sys.exit(1)
    best = {place(r["part"], str(r["pair"])): float(r["best_known_return"]) for r in results}
    draw_comparison(path, panels, best)


def place(part: str, pair: str) -> str:
    """A pair, and the part of the folder that it lies in if it is not at its top."""
    return f"{part}/{pair}" if part else pair


def goals(scores: list[dict[str, Any]]) -> str:
    """How many of the greedy episodes end at the goal."""
    return f"{sum(s['outcome'] == 'goal' for s in scores)} of {len(scores)}"


if __name__ == "__main__":
    main()
