"""`python -m ship_trl cases target=CASE|SUITE`: list and draw cases, or rank sources for one case.

Of several cases (with commas between them, or a suite; default: target=paper,ship) the tables have ideal
paths, target ships and similarity. Many cases are drawn on one page, with their classes of encounter; of
more than 60, the first. Of random encounters the page has the scenes of the first seeds. For one case, all
other cases are ranked as sources by the gain that is expected, and one source is recommended, or none.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

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
from ship_trl.study.transfers import TABLE, Transfer, read_transfers, transfers_to
from ship_trl.transfer.casebase import PLANS, CaseBase, rank
from ship_trl.transfer.law import ARM, ZERO_SHOT, Expected, describe, load_laws
from ship_trl.transfer.similarity import MEASURES, describe_similarity, distance, similarity

DEFAULT = "paper,ship"
# Sources and transfers listed for a target, and cases compared in a matrix.
MAX_SHOWN, MAX_ROWS = 12, 8
# Cases that are listed and drawn, and pictures of random encounters.
MAX_PICTURES, EXAMPLES = 60, 20
# Sources are ranked by the gain that is expected, unless by a measure of similarity.
GAIN = "gain"


def main(arguments: list[str] | None = None) -> None:
    """Print the tables and write the picture."""
    parser = make_parser("cases", __doc__)
    add_target(parser, DEFAULT)
    by = (
        "what to list sources by: expected gain (default), similarity (equation 8), distance (7), side, ships"
    )
    parser.add_argument("--by", choices=(GAIN, *MEASURES), default=GAIN, help=by)
    stored = "folder of trained networks; default: %(default)s"
    parser.add_argument("--case-base", type=Path, default=Path("outputs/case_base"), help=stored)
    table = f"a report's {TABLE}: recommend by what was measured on this target"
    parser.add_argument("--measured", type=Path, metavar="FILE", help=table)
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
            transfers = [replace(one, target=given) for one in transfers_to(target, known, sources)]
            found = find_candidates(target, sources, world, options.case_base, options.by)
            show_candidates(target, found, options.by)
            recommend(target, words, found, transfers)
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


class Candidate(NamedTuple):
    """A source: the expected gain, measures, and of its network, if it has one, the score and words."""

    case: Case
    expected: Expected
    measured: dict[str, float]
    zero_shot: float | None
    network: str
    words: tuple[str, ...]


def find_candidates(
    target: Case, sources: list[Case], world: World, case_base: Path, by: str
) -> list[Candidate]:
    """Return the sources for a target, first those with the largest expected gain, or by a measure.

    The search for the target's best known plan is kept in the case base, where runs look for it.
    """
    from ship_trl.fast.worlds import make_env
    from ship_trl.policies.named import load_network
    from ship_trl.policies.reference import score_bounds, zero_shot

    stored = CaseBase(case_base)
    bundled = {one.fingerprint: one.file for one in networks()}
    of_cases, with_score = load_laws()
    env, found, bounds = make_env(suite_of(target), world), list[Candidate](), None
    for match in rank(target, sources, world, "similarity" if by == GAIN else by):
        case = match.case
        files = {}
        if case.fingerprint in bundled:
            files["bundled", override("source_weights", "pretrained")] = bundled[case.fingerprint]
        if best := stored.representative(case):
            files["stored", override("source_file", best.policy)] = best.policy
        scores = {}
        for key, file in files.items():
            bounds = bounds or score_bounds(target, world, case_base / PLANS)
            scores[key] = zero_shot(load_network(file, env), target, world, bounds)
        first = max(scores, key=scores.__getitem__, default=None)
        values, score = describe(case, target, world), None if first is None else scores[first]
        law = of_cases if score is None else with_score
        expected = law.expect(case, target, values if score is None else values | {ZERO_SHOT: score})
        kind, words = ("", ()) if first is None else (first[0], first[1:])
        found.append(Candidate(case, expected, match.measured, score, kind, words))
    return sorted(found, key=lambda one: -one.expected.gain) if by == GAIN else found


def show_candidates(target: Case, found: list[Candidate], by: str) -> None:
    """Print the first sources for a target with their expected gains."""
    rows = []
    for one in found[:MAX_SHOWN]:
        gain = f"{one.expected.gain:+.2f}"
        score = "" if one.zero_shot is None else f"{one.zero_shot:.2f}"
        measured = (f"{value:.2f}" for value in one.measured.values())
        rows.append((one.case.name, gain, *measured, score, one.network))
    headings = ("source", "expected gain", *MEASURES, "score before training", "network")
    show(headings, rows, title=f"Sources for case {target.name}, by {by}")


def recommend(target: Case, given: list[str], found: list[Candidate], known: list[Transfer]) -> None:
    """Print one recommendation and why: by what was measured, else by the law of transfer.

    `given` are the words in the commands that are printed that say the target: its name or path, and keys.
    Of measured gains the lower bound decides, because the largest of many may be due to chance.
    """
    lines, start = [command(*given, "method=scratch")], f"Recommended for case {target.name}"
    scratch = f"{start}: learn from scratch, for"
    if known:
        best = known[0]
        of = f"the {len(known)} measured transfers (their 95 % intervals hold together)"
        interval = f"{best.low:+.3f} to {best.high:+.3f}, {best.seeds} seeds"
        what = f"{best.arm} from case {best.source}: gain {best.gain:+.3f} ({interval})"
        words = f"{scratch} none of {of} is shown to gain. The best: {what}"
        if best.low > 0:
            lines, words = best.commands(), f"{start}: {what}: the highest lower end of {of}"
    elif not found:
        words = f"{scratch} there is no other case"
    else:
        first = max(found, key=lambda one: one.expected.gain)
        gain, low, high, constant, quality, difficulty, closeness = first.expected
        what = f"expected gain {gain:+.2f} ({low:+.2f} to {high:+.2f} in nine of ten runs)"
        score = "its network must be trained first, for four runs' time"
        if first.zero_shot is not None:
            score = f"its network scores {first.zero_shot:.2f} there before training"
        apart = ", ".join(f"{name} {first.measured[name]:.2f}" for name in ("similarity", "distance"))
        words = f"{scratch} no source is expected to help. The best: case {first.case.name}, {what}"
        if gain > 0:
            lines = [command(override("source", first.case.name), *first.words, *given, f"+arm={ARM}")]
            doubt = "; it may also harm" * (low < 0)
            words = f"{start}: copy the whole network ({ARM}) of case {first.case.name}: {what}{doubt}"
        words += (
            f"\nWhy: a mean pair gains {constant:+.2f}, this target {difficulty:+.2f}, this source "
            f"{quality:+.2f}, closeness {closeness:+.2f} ({apart}; {score})\n"
            "Gains are in mean greedy score over scratch, as in runs of 12,000 steps that observe numbers; "
            "from pixels trust their order alone (studies/law/README.md)"
        )
    sys.stdout.write("".join(f"{line}\n" for line in (words, *lines)))
