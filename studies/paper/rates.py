"""`python -m studies.paper.rates`: how often each grade (grades.md) comes out, by what is true.

Grades the claims of a study. Then it grades data whose truth is known: arms shuffled within each seed, and
differences moved to zero, to the margin, and to the possible gain.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive
from ship_trl.run.console import show
from ship_trl.study.compare import SEED
from ship_trl.study.statistics import LEVEL, interquartile_mean
from ship_trl.study.study import Records, Study, finished_study
from studies.paper.claims import ALL, claims
from studies.paper.contrasts import Claimed, add_p_values
from studies.paper.judge import Claim, Finding, Grade, count_grades, grade, grade_all, measure_parts

FOLDER = Path("outputs/confirmatory")
# A test of spread takes 0.2 s with all its permutations. With these its least p, times the eight contrasts of
# a claim, is still below the level.
MAX_PERMUTATIONS = 400
Counts = Mapping[Grade, float]


def main(arguments: list[str]) -> None:
    """Grade, simulate, and print a table."""
    parser = make_parser("rates", __doc__)
    parser.prog = "python -m studies.paper.rates"
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER, help=f"a study (default {FOLDER})")
    add_number(parser, "--draws", Positive, 200, "simulated studies a row (default 200)")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    options = parser.parse_args(arguments)
    with refusals():
        run(options)


def run(options: Namespace) -> None:
    """Print the mean number of claims of each grade, by what is true."""
    study = finished_study(options.folder, claims=claims())
    parts = [*measure_parts(study, ALL).values()]
    rows = {
        "the study": count_grades([grade(findings).grade for findings in parts]),
        "labels shuffled": shuffled(study, options.draws),
        **moved(parts, study.claims.margin or 0.0, options.draws),
    }
    cells = [[name, *(f"{count[one]:.2f}" for one in Grade)] for name, count in rows.items()]
    without = sum(any(one.found.margin is None for one in findings) for findings in parts)
    bounded = sum(any(one.claimed is Claimed.no_more for one in findings) for findings in parts)
    sys.stdout.write(
        f"Mean number of the {len(parts)} claims with each grade, {options.draws} draws a row. In moved "
        f"rows, parts without a margin stay at zero, so {without} claims cannot be supported. Parts of the "
        f"form 'no more than the margin' ({bounded} claims) stay at zero too, where they are true.\n\n"
    )
    show(["data", *Grade], cells, options.markdown)


def shuffled(study: Study, draws: int, hypotheses: Sequence[Claim] = ALL) -> Counts:
    """Return the mean number of claims of each grade if labels of arms mean nothing.

    Within each seed, all runs on the same target case change places, and all contrasts are measured again.
    """
    rng = np.random.default_rng(SEED)
    seen = study.first(study.whole_looks[-1], LEVEL / 2)
    found = [grade_all(shuffle(seen, rng), hypotheses, MAX_PERMUTATIONS).values() for _ in range(draws)]
    return mean_counts([graded.grade for graded in one] for one in found)


def shuffle(study: Study, rng: np.random.Generator) -> Study:
    """Return a study whose runs on the same target case change places, within each seed."""
    places = defaultdict(list)
    for key, record in sorted(study.records.items()):
        places[record.target, key[3]].append(key)
    records: Records = {}
    for keys in places.values():
        order = rng.permutation(len(keys))
        records |= {key: study.records[keys[k]] for key, k in zip(keys, order, strict=True)}
    return replace(study, records=records)


def moved(claims: Sequence[Sequence[Finding]], share: float, draws: int) -> dict[str, Counts]:
    """Return the mean number of claims of each grade if all effects have the same known size, by that size.

    Seeds are resampled jointly over all parts, so parts depend on each other as in the study. `share` is the
    margin's of the gain.
    """
    truths = {"nothing": 0.0, "the margin": 1.0, "what could be gained": 1 / share}
    seeds = max((one.found.seeds for parts in claims for one in parts), default=1)
    chosen = np.random.default_rng(SEED).integers(0, seeds, (draws, seeds))
    return {
        f"moved to {name}": mean_counts(
            [grade([move(one, size, draw) for one in parts]).grade for parts in claims] for draw in chosen
        )
        for name, size in truths.items()
    }


def move(part: Finding, size: float, seeds: NDArray[np.int64]) -> Finding:
    """Return a part with the differences of resampled seeds, moved to a truth: a size in margins.

    Differences are centred by their interquartile mean. Parts that claim no more than the margin stay at
    zero, where they are true. So do parts without a margin; a claim with such a part cannot be supported.
    Spreads have no differences, so they show nothing (p = 1).
    """
    found = part.found
    if not found.differences:
        return replace(part, found=replace(found, p=1.0, against=1.0))
    truth = size * (found.margin or 0.0) if part.claimed is Claimed.above else 0.0
    values = np.array(found.differences)
    drawn = (values - interquartile_mean(values))[seeds] + truth
    drawn_part = replace(found, differences=tuple(drawn.tolist()))
    return replace(part, found=add_p_values(drawn_part, part.claimed, found.margin))


def mean_counts(draws: Iterable[Sequence[Grade]]) -> Counts:
    """Return the mean number of claims of each grade over draws."""
    found = [count_grades(grades) for grades in draws]
    return {grade: float(np.mean([count[grade] for count in found])) for grade in Grade}


if __name__ == "__main__":
    main(sys.argv[1:])
