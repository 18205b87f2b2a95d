"""`python -m ship_trl cases target=CASE|SUITE`: list and draw cases, or rank sources for one case.

Of several cases (with commas between them, or a suite; default: target=paper,ship) the tables have ideal
paths, target ships and similarity. Many cases are drawn on one page, with their classes of encounter; of
more than 60, the first. Of random encounters the page has the scenes of the first seeds. For one case, all
other cases are ranked as sources, and an arm is recommended.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import islice
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_output, add_target, make_parser
from ship_trl.config.errors import command, override, require
from ship_trl.config.paths import conf_files
from ship_trl.config.types import World
from ship_trl.policies.pretrained import networks
from ship_trl.run.console import show
from ship_trl.run.entries import find_suites
from ship_trl.sim.cases import (
    Case,
    Suite,
    is_suite,
    read_values,
    readable_cases,
    suite_of,
    to_course,
)
from ship_trl.study.transfers import BUNDLED_TABLE, TABLE, Transfer, read_transfers, transfers_to
from ship_trl.transfer.casebase import PLANS, CaseBase, rank
from ship_trl.transfer.similarity import MEASURES, describe_similarity, distance, similarity

DEFAULT = "paper,ship"
# Sources and transfers listed for a target, and cases compared in a matrix.
MAX_SHOWN, MAX_ROWS = 12, 8
# Cases that are listed and drawn, and pictures of random encounters.
MAX_PICTURES, EXAMPLES = 60, 20
# Of the zero-shot score in outputs/sources/numbers_judgements.csv: the arm that gains most, and its gain with
# its 95 % interval.
ZERO_SHOT_ARM, ZERO_SHOT_GAIN = "FTW", (0.3144, 0.2614, 0.3674)


def main(arguments: list[str] | None = None) -> None:
    """Print the tables and write the picture."""
    parser = make_parser("cases", __doc__)
    add_target(parser, DEFAULT)
    by = "what to rank by: similarity is equation 8, distance 7, side the ideal path's, ships their number"
    parser.add_argument("--by", choices=MEASURES, default="similarity", help=by)
    stored = "folder of trained networks; default: %(default)s"
    parser.add_argument("--case-base", type=Path, default=Path("outputs/case_base"), help=stored)
    table = f"a report's {TABLE}, to recommend by; default: that of the confirmatory study"
    # The table exists once a study is finished.
    bundled = BUNDLED_TABLE if BUNDLED_TABLE.is_file() else None
    parser.add_argument("--measured", type=Path, default=bundled, metavar="FILE", help=table)
    picture = "where the picture goes; default: outputs/cases.png, of a target with its name"
    add_output(parser, "--picture", (".png",), picture)
    options = parser.parse_args(arguments)
    with refusals():
        names, suites, world = find_suites(options.words, DEFAULT)
        every = {case.name: case for suite in suites for case in suite.cases}
        cases = dict(islice(every.items(), MAX_PICTURES))
        name, note = f"cases_{'-'.join(suite.name for suite in suites)}", ""
        traffic = next((suite for suite in suites if suite.traffic), None)
        if traffic is not None:
            allowed = "alone, where it is a suite of random encounters"
            require(len(suites) == 1, "target", allowed, ",".join(names))
            note = f": scenes of the seeds 0 to {EXAMPLES - 1}"
        elif len(cases) > 1:
            show_cases(cases)
            show_pairs(cases, world)
            name = "cases" if names == DEFAULT.split(",") else name
            note = f": the first {MAX_PICTURES} of {len(every)} cases" * (len(every) > MAX_PICTURES)
        else:
            (target,) = cases.values()
            # Its name is no word of a command where it was given by a path.
            given = target.name if is_suite(names[0]) else names[0]
            sources = [case for case in readable_cases(world) if case.fingerprint != target.fingerprint]
            known = [] if options.measured is None else read_transfers(options.measured)
            words = [
                override("target", given),
                *(word for word in options.words if not word.startswith("target=")),
            ]
            show_ranking(target, words, sources, world, options.by, CaseBase(options.case_base))
            show_expected(target, words, sources, world, options.case_base / PLANS)
            show_measured(target, given, transfers_to(target, known, sources))
            name = f"case_{target.name}"
        path = options.picture or Path("outputs") / f"{name}.png"
        draw(path, cases, traffic, world)
        sys.stdout.write(f"{path}{note}\n")


def draw(path: Path, cases: dict[str, Case], traffic: Suite | None, world: World) -> None:
    """Write a page with a picture of each case, or of random encounters."""
    import torch

    from ship_trl.fast.worlds import draw_starts
    from ship_trl.sim.state import initial_state
    from ship_trl.view.pages import write_case_page

    if traffic is not None:
        states = draw_starts(traffic, world, EXAMPLES, 0)
        write_case_page(path, [f"seed {seed}" for seed in range(EXAMPLES)], states, world)
    else:
        places = max(len(case.target_ships) for case in cases.values())
        states = torch.stack([initial_state(case, world, places) for case in cases.values()])
        write_case_page(path, list(cases), states, world, [case.scale for case in cases.values()])


def show_cases(cases: dict[str, Case]) -> None:
    """Print ideal path, target ships and fingerprint of each case."""
    rows = []
    for name, case in cases.items():
        ships = "; ".join(
            f"{s.x:g}, {s.y:g}, {to_course(s.heading):03g}, {s.speed:g}" for s in case.target_ships
        )
        rows.append((name, case.ideal_path, ships or "none", case.fingerprint))
    headings = ("case", "ideal path", "target ships: x, y (m), course (deg), speed (m/s)", "fingerprint")
    show(headings, rows, title="Cases")


def show_pairs(cases: dict[str, Case], world: World) -> None:
    """Print table 2 with the properties behind each number, and the similarity of all pairs of few cases."""
    pairs = []
    for path in conf_files("pair").values():
        pair = read_values(path)
        source, target = str(pair.source), str(pair.target)
        # A working directory may lack a case of a shipped pair.
        if source in cases and target in cases:
            one, other = cases[source], cases[target]
            value, apart = f"{similarity(one, other):.2f}", f"{distance(one, other, world):.2f}"
            pairs.append((path.stem, source, target, value, apart, *describe_similarity(one, other)))
    if pairs:
        headings = ("pair", "source", "target", "similarity", "distance", "common", "different")
        pairs.sort(key=lambda row: row[1:])
        show(headings, pairs, title="Table 2: similarity by equation 8, distance by equation 7")
    if len(cases) <= MAX_ROWS:
        ships = cases.values()
        matrix = [(one.name, *(f"{similarity(one, other):.2f}" for other in ships)) for one in ships]
        show(("", *cases), matrix, title="Similarity of every source (row) to every target (column)")


def show_ranking(
    target: Case, given: list[str], sources: list[Case], world: World, by: str, stored: CaseBase
) -> None:
    """Print the sources for a target, best first, with stored networks and the paper's arm.

    `given` are the words in the commands that are printed that say the target: its name or path, and keys.
    """
    fingerprints = [entry.fingerprint for entry in stored.entries()]
    ranking = rank(target, sources, world, by)[:MAX_SHOWN]
    arms = [[override(key, value) for key, value in match.arm.keys.items()] for match in ranking]
    rows = []
    for match, arm in zip(ranking, arms, strict=True):
        measured = (f"{value:.2f}" for value in match.measured.values())
        stored_count = str(fingerprints.count(match.case.fingerprint))
        rows.append((match.case.name, *measured, " ".join(arm), stored_count))
    headings = ("source", *MEASURES, "arm, by the paper", "stored networks")
    show(headings, rows, title=f"Sources for case {target.name}, by {by}")
    if not ranking:
        return
    if max(match.measured["similarity"] for match in ranking) == 0:
        sys.stdout.write(f"By the paper's rule: no case is similar to case {target.name}.\n")
        return
    first = ranking[0].case
    words = override("source", first.name), *given, *arms[0]
    sys.stdout.write(f"By the paper's rule:\n{command(*words)}\n")
    if best := stored.representative(first):
        known = f"{best.arm}, seed {best.seed}, greedy return {best.best_return:.1f}"
        sys.stdout.write(f"with the best stored network of case {first.name} ({known}):\n")
        sys.stdout.write(f"{command(*words, override('source_file', best.policy))}\n")


def show_measured(target: Case, given: str, found: list[Transfer]) -> None:
    """Print the measured gains of transfers to a target, largest lower bound first, and recommend the first.

    The lower bound decides, because the largest of many measured gains may be due to chance.
    """
    if not found:
        sys.stdout.write(f"By measurement: no transfer to case {target.name} was measured.\n")
        return
    title = (
        f"Measured on case {target.name}: mean score of all training episodes, compared with scratch with "
        f"the same epsilon. The {len(found)} intervals hold together at 95 %; each alone would be narrower."
    )
    rows = []
    for one in found[:MAX_SHOWN]:
        start = "1" if one.epsilon_start is None else f"{one.epsilon_start:g}"
        between = f"{one.low:+.3f} to {one.high:+.3f}"
        rows.append((one.source, one.arm, start, f"{one.gain:+.3f}", between, str(one.seeds)))
    show(("source", "arm", "epsilon from", "gain", "interval", "seeds"), rows, title=title)
    best = found[0]
    if best.low > 0:
        lines = [f"By measurement, the one of {len(found)} transfers with the highest lower bound:"]
        lines += replace(best, target=given).commands()
    else:
        lines = [f"By measurement, none of {len(found)} transfers is shown to gain; without a source:"]
        lines.append(command(override("target", given), "method=scratch"))
    sys.stdout.write("\n".join(lines) + "\n")


def show_expected(target: Case, given: list[str], sources: list[Case], world: World, plans: Path) -> None:
    """Print the bundled network with the largest zero-shot score, which predicts gains best.

    The search of a plan is kept in the folder `plans`, where runs look for it.
    """
    from ship_trl.fast.worlds import make_env
    from ship_trl.policies.named import load_network
    from ship_trl.policies.reference import score_bounds, zero_shot

    names, bounds = {case.name for case in sources}, score_bounds(target, world, plans)
    env = make_env(suite_of(target), world)
    scores = {
        one.name: zero_shot(load_network(one.file, env), target, world, bounds)
        for one in networks()
        if one.name in names
    }
    if not scores:
        return
    first = max(scores, key=scores.__getitem__)
    words = override("source", first), "source_weights=pretrained", *given
    gain = "{:+.2f} ({:+.2f} to {:+.2f})".format(*ZERO_SHOT_GAIN)
    sys.stdout.write(
        "By zero_shot, a network's score on the target before training there, which predicted gains best in "
        "the study of sources (studies/sources): "
        f"{scores[first]:.2f}, the largest of {len(scores)} bundled networks. There such choices gained "
        f"{gain} in mean greedy score with {ZERO_SHOT_ARM}:\n"
        f"{command(*words, f'+arm={ZERO_SHOT_ARM}')}\n"
    )
