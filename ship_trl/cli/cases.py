"""`python -m ship_trl cases`: list and draw the cases, or rank sources for a target."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from omegaconf import OmegaConf
from rich.console import Console
from rich.table import Table

from ship_trl.cli.parser import add_output, make_parser
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World
from ship_trl.files.disk import replacing
from ship_trl.sim.cases import Case, case_names, load_case, load_world
from ship_trl.transfer.casebase import CaseBase, rank
from ship_trl.transfer.measured import PACKAGED, TABLE, Transfer, read_transfers, transfers_to
from ship_trl.transfer.similarity import MEASURES, distance, in_words, similarity

# Transfers listed for a target.
MAX_TRANSFERS_SHOWN = 12
console = Console(highlight=False, markup=False)


def main(arguments: list[str] | None = None) -> None:
    """Print the tables and write the contact sheet."""
    parser = make_parser("cases", __doc__)
    parser.add_argument("--target", help="rank all other cases as sources for this one and recommend an arm")
    parser.add_argument(
        "--by", choices=MEASURES, default="similarity", help="rank by similarity (equation 8) or distance (7)"
    )
    parser.add_argument(
        "--case-base", type=Path, default=Path("outputs/case_base"), help="folder of trained networks"
    )
    parser.add_argument(
        "--measured",
        type=Path,
        metavar="FILE",
        help=f"a report's {TABLE}, to recommend by; default: that of the confirmatory study",
    )
    picture = "where the picture goes; default: outputs/cases.png, of a target outputs/case_NAME.png"
    add_output(parser, "--picture", (".png",), picture)
    parser.add_argument("--no-picture", action="store_true", help="print only")
    options = parser.parse_args(arguments)
    try:
        world = load_world()
        cases = {name: load_case(name, world) for name in case_names()}
        if options.target is not None:
            target = load_case(options.target, world, "--target")
            bases = [case for case in cases.values() if case.fingerprint != target.fingerprint]
            # The table exists once a study is finished.
            table = options.measured or (PACKAGED if PACKAGED.is_file() else None)
            known = [] if table is None else read_transfers(table)
            show_ranking(target, bases, world, options.by, CaseBase(options.case_base))
            show_measured(target, transfers_to(target, known, bases))
            name, shown = f"case_{target.name}.png", [target]
        else:
            show_cases(cases)
            show_pairs(cases, world)
            name, shown = "cases.png", list(cases.values())
        if not options.no_picture:
            write_picture(options.picture or Path("outputs") / name, shown, world)
    except (ConfigError, OSError) as error:
        print_error(str(error))
        sys.exit(1)


def show_cases(cases: dict[str, Case]) -> None:
    """Print ideal path, target ships and fingerprint of each case."""
    table = Table(title="Cases", title_justify="left")
    for name in ("case", "ideal path", "target ships: x, y (m), heading (deg), speed (m/s)", "fingerprint"):
        table.add_column(name)
    for name, case in cases.items():
        ships = "; ".join(f"{s.x:g}, {s.y:g}, {s.heading:g}, {s.speed:g}" for s in case.target_ships)
        table.add_row(name, case.ideal_path, ships or "none", case.fingerprint)
    console.print(table)


def bundled_pairs(cases: dict[str, Case]) -> dict[tuple[str, str], str]:
    """Return the names of the pairs in conf/pair by (source, target), in the order of the paper's table 2."""
    found = {}
    for path in (conf_dir() / "pair").glob("*.yaml"):
        values = OmegaConf.load(path)
        found[values.source, values.target] = path.stem
    return {pair: found[pair] for pair in sorted(found) if set(pair) <= set(cases)}


def show_pairs(cases: dict[str, Case], world: World) -> None:
    """Print table 2 with the properties behind each number, then the similarity of all pairs."""
    named = bundled_pairs(cases)
    table = Table(title="Table 2: similarity by equation 8, distance by equation 7", title_justify="left")
    for name in ("pair", "source", "target", "similarity", "distance", "common", "different"):
        table.add_column(name, justify="right" if name in ("similarity", "distance") else "left")
    for (source, target), pair in named.items():
        base, case = cases[source], cases[target]
        common, different = in_words(base, case)
        value, apart = similarity(base, case), distance(base, case, world)
        table.add_row(pair, source, target, f"{value:.2f}", f"{apart:.2f}", common, different)
    console.print(table)
    table = Table(title="Similarity of every source (row) to every target (column)", title_justify="left")
    table.add_column("")
    for target in cases:
        table.add_column(target, justify="right")
    for source, base in cases.items():
        table.add_row(source, *(f"{similarity(base, case):.2f}" for case in cases.values()))
    console.print(table)


def show_ranking(target: Case, bases: list[Case], world: World, by: str, stored: CaseBase) -> None:
    """Print the sources for a target, best first, with their stored networks and the recommended arm."""
    table = Table(title=f"Sources for case {target.name}, by {by}", title_justify="left")
    for name in ("source", *MEASURES, "arm, by the paper", "stored networks"):
        table.add_column(name, justify="right" if name in MEASURES else "left")
    kept = stored.entries()
    ranking = rank(target, bases, world, by)
    for match in ranking:
        arm = " ".join(f"{key}={value}" for key, value in match.arm.keys.items())
        count = sum(entry.fingerprint == match.case.fingerprint for entry in kept)
        measured = (f"{value:.2f}" for value in match.measured.values())
        table.add_row(match.case.name, *measured, arm, str(count))
    console.print(table)
    if ranking:
        console.print("By the paper's rule:")
        first = ranking[0]
        arm = " ".join(f"{key}={value}" for key, value in first.arm.keys.items())
        line = f"python -m ship_trl source={first.case.name} target={target.name} {arm}"
        console.print(line, markup=False, soft_wrap=True)
        best = stored.representative(first.case)
        if best is not None:
            known = f"{best.arm}, seed {best.seed}, greedy return {best.best_return:.1f}"
            console.print(
                f"with the best network of case {first.case.name} that is stored ({known}):", soft_wrap=True
            )
            console.print(f"{line} {shlex.quote(f'source_file={best.policy}')}", markup=False, soft_wrap=True)


def show_measured(target: Case, found: list[Transfer]) -> None:
    """Print the measured gains of transfers to a target; recommend the first if it is shown to gain."""
    if not found:
        console.print(f"By measurement: no transfer to case {target.name} from these cases was measured.")
        return
    title = (
        f"Measured on case {target.name}: mean score of all training episodes, above scratch with the same "
        f"epsilon. The {len(found)} intervals hold all at once at 95 %: each alone would be narrower."
    )
    table = Table(title=title, title_justify="left")
    for name in ("source", "arm", "epsilon from", "gain", "interval", "seeds"):
        table.add_column(name, justify="right" if name in ("gain", "interval", "seeds") else "left")
    for one in found[:MAX_TRANSFERS_SHOWN]:
        start = "1" if one.epsilon_start is None else f"{one.epsilon_start:g}"
        between = f"{one.low:+.3f} to {one.high:+.3f}"
        table.add_row(one.source, one.arm, start, f"{one.gain:+.3f}", between, str(one.seeds))
    console.print(table)
    # `found` is sorted by lower bound: of many arms the one with the largest gain may just be lucky.
    best = found[0]
    if best.low > 0:
        console.print(f"By measurement, of {len(found)} transfers the one whose interval begins highest:")
        for line in best.commands():
            console.print(line, markup=False, soft_wrap=True)
    else:
        console.print(f"By measurement, none of {len(found)} transfers is shown to gain; without a source:")
        console.print(f"python -m ship_trl target={target.name} method=scratch", markup=False, soft_wrap=True)


def write_picture(path: Path, cases: list[Case], world: World) -> None:
    """Write the contact sheet: each case as people and as the network see it."""
    from ship_trl.view.contact_sheet import write_contact_sheet

    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as draft:
        write_contact_sheet(draft, cases, world)
    console.print(str(path), markup=False)
