"""`python -m ship_trl cases`: list and draw the cases, or rank sources for a target."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from omegaconf import OmegaConf

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_output, make_parser
from ship_trl.cli.table import show
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World
from ship_trl.sim.cases import Case, case_names, load_case, load_world
from ship_trl.transfer.casebase import CaseBase, Match, rank
from ship_trl.transfer.measured import BUNDLED_TABLE, TABLE, Transfer, read_transfers, transfers_to
from ship_trl.transfer.similarity import MEASURES, describe_similarity, distance, similarity

# Transfers listed for a target.
MAX_TRANSFERS_SHOWN = 12


def main(arguments: list[str] | None = None) -> None:
    """Print the tables and write the contact sheet."""
    parser = make_parser("cases", __doc__)
    parser.add_argument("--target", help="rank all other cases as sources for this one and recommend an arm")
    parser.add_argument(
        "--by", choices=MEASURES, default="similarity", help="rank by similarity (equation 8) or distance (7)"
    )
    stored = "folder of trained networks; default: outputs/case_base"
    parser.add_argument("--case-base", type=Path, default=Path("outputs/case_base"), help=stored)
    table = f"a report's {TABLE}, to recommend by; default: that of the confirmatory study"
    parser.add_argument("--measured", type=Path, metavar="FILE", help=table)
    picture = "where the picture goes; default: outputs/cases.png, of a target outputs/case_NAME.png"
    add_output(parser, "--picture", (".png",), picture)
    options = parser.parse_args(arguments)
    with refusals():
        world = load_world()
        cases = {name: load_case(name, world) for name in case_names()}
        if options.target is None:
            show_cases(cases)
            show_pairs(cases, world)
            name, shown = "cases.png", list(cases.values())
        else:
            target = load_case(options.target, world, "--target")
            bases = [case for case in cases.values() if case.fingerprint != target.fingerprint]
            # The table exists once a study is finished.
            measured = options.measured or (BUNDLED_TABLE if BUNDLED_TABLE.is_file() else None)
            known = [] if measured is None else read_transfers(measured)
            show_ranking(target, bases, world, options.by, CaseBase(options.case_base))
            show_measured(target, transfers_to(target, known, bases))
            name, shown = f"case_{target.name}.png", [target]
        write_picture(options.picture or Path("outputs") / name, shown, world)


def show_cases(cases: dict[str, Case]) -> None:
    """Print ideal path, target ships and fingerprint of each case."""
    rows = []
    for name, case in cases.items():
        ships = "; ".join(f"{s.x:g}, {s.y:g}, {s.heading:g}, {s.speed:g}" for s in case.target_ships)
        rows.append((name, case.ideal_path, ships or "none", case.fingerprint))
    headings = ("case", "ideal path", "target ships: x, y (m), heading (deg), speed (m/s)", "fingerprint")
    show(headings, rows, title="Cases")


def bundled_pairs(cases: dict[str, Case]) -> dict[tuple[str, str], str]:
    """Return the names of the pairs in conf/pair by (source, target), in the order of the paper's table 2."""
    found = {}
    for path in (conf_dir() / "pair").glob("*.yaml"):
        values = OmegaConf.load(path)
        found[values.source, values.target] = path.stem
    return {pair: found[pair] for pair in sorted(found) if set(pair) <= set(cases)}


def show_pairs(cases: dict[str, Case], world: World) -> None:
    """Print table 2 with the properties behind each number, then the similarity of all pairs."""
    rows = []
    for (source, target), pair in bundled_pairs(cases).items():
        base, case = cases[source], cases[target]
        value, apart = similarity(base, case), distance(base, case, world)
        rows.append((pair, source, target, f"{value:.2f}", f"{apart:.2f}", *describe_similarity(base, case)))
    headings = ("pair", "source", "target", "similarity", "distance", "common", "different")
    show(headings, rows, title="Table 2: similarity by equation 8, distance by equation 7")
    table = [
        (name, *(f"{similarity(base, case):.2f}" for case in cases.values())) for name, base in cases.items()
    ]
    show(("", *cases), table, title="Similarity of every source (row) to every target (column)")


def show_ranking(target: Case, bases: list[Case], world: World, by: str, stored: CaseBase) -> None:
    """Print the sources for a target, best first, with stored networks and the paper's arm."""
    rows, kept, ranking = [], stored.entries(), rank(target, bases, world, by)
    for match in ranking:
        count = sum(entry.fingerprint == match.case.fingerprint for entry in kept)
        measured = (f"{value:.2f}" for value in match.measured.values())
        rows.append((match.case.name, *measured, arm_words(match), str(count)))
    headings = ("source", *MEASURES, "arm, by the paper", "stored networks")
    show(headings, rows, title=f"Sources for case {target.name}, by {by}")
    if ranking:
        first = ranking[0]
        line = f"python -m ship_trl source={first.case.name} target={target.name} {arm_words(first)}"
        sys.stdout.write(f"By the paper's rule:\n{line}\n")
        if best := stored.representative(first.case):
            known = f"{best.arm}, seed {best.seed}, greedy return {best.best_return:.1f}"
            sys.stdout.write(f"with the best stored network of case {first.case.name} ({known}):\n")
            sys.stdout.write(f"{line} {shlex.quote(f'source_file={best.policy}')}\n")


def arm_words(match: Match) -> str:
    """Return the overrides that choose a recommended arm."""
    return " ".join(f"{key}={value}" for key, value in match.arm.keys.items())


def show_measured(target: Case, found: list[Transfer]) -> None:
    """Print the measured gains of transfers to a target; recommend the first if it is shown to gain."""
    if not found:
        sys.stdout.write(
            f"By measurement: no transfer to case {target.name} from these cases was measured.\n"
        )
        return
    title = (
        f"Measured on case {target.name}: mean score of all training episodes, above scratch with the same "
        f"epsilon. The {len(found)} intervals hold all at once at 95 %: each alone would be narrower."
    )
    rows = []
    for one in found[:MAX_TRANSFERS_SHOWN]:
        start = "1" if one.epsilon_start is None else f"{one.epsilon_start:g}"
        between = f"{one.low:+.3f} to {one.high:+.3f}"
        rows.append((one.source, one.arm, start, f"{one.gain:+.3f}", between, str(one.seeds)))
    show(("source", "arm", "epsilon from", "gain", "interval", "seeds"), rows, title=title)
    # `found` is sorted by lower bound: of many arms the one with the largest gain may just be lucky.
    best = found[0]
    lines = [f"By measurement, of {len(found)} transfers the one whose interval begins highest:"]
    lines += best.commands()
    if best.low <= 0:
        lines = [f"By measurement, none of {len(found)} transfers is shown to gain; without a source:"]
        lines.append(f"python -m ship_trl target={target.name} method=scratch")
    sys.stdout.write("\n".join(lines) + "\n")


def write_picture(path: Path, cases: list[Case], world: World) -> None:
    """Write the contact sheet: each case as people and as the network see it."""
    from ship_trl.view.contact_sheet import write_contact_sheet

    path.parent.mkdir(parents=True, exist_ok=True)
    write_contact_sheet(path, cases, world)
    sys.stdout.write(f"{path}\n")
