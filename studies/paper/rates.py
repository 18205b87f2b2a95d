"""`python -m studies.paper.rates`: how often each grade (grades.md) comes out, by what is true.

Grades the claims of a study. Then it grades data whose truth is known: arms shuffled within each seed, and
differences moved to zero, to the margin, and to the possible gain.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive
from ship_trl.run.console import show
from ship_trl.study.compare import SEED
from ship_trl.study.statistics import (
    LEVEL,
    TOLERANCE,
    TRIM,
    degrees_of_freedom,
    interquartile_mean,
)
from ship_trl.study.study import Records, Study, finished_study
from studies.paper.claims import ALL, claims
from studies.paper.contrasts import Claimed
from studies.paper.judge import (
    Claim,
    Evidence,
    Finding,
    Grade,
    count_grades,
    grade,
    grade_all,
    grade_claim,
    grade_parts,
    measure_parts,
)

FOLDER = Path("outputs/confirmatory")
# A test of spread takes 0.2 s with all its permutations. With these its least p, times the eight contrasts of
# a claim, is still below the level.
MAX_PERMUTATIONS = 400
Floats = NDArray[np.float64]
Counts = Mapping[Grade, float]
# For a claim, against it, and for an effect below the margin, as `Evidence` has them: [draws] each.
PValues = tuple[Floats, Floats, Floats | None]


@dataclass(frozen=True)
class Samples:
    """Means and standard errors of resampled differences around zero, [draws] each."""

    mean: Floats
    error: Floats
    freedom: Floats

    def p_above(self, bound: float, truth: float) -> Floats:
        """Return the one-sided p-values against a mean of at most `bound`, for an effect of `truth`."""
        value = self.mean + truth - bound
        is_exact = self.error < TOLERANCE
        p = special.stdtr(self.freedom, -value / np.where(is_exact, 1.0, self.error))
        return np.where(is_exact, np.where(value > TOLERANCE, 0.0, 1.0), p)

    def p_below(self, bound: float, truth: float) -> Floats:
        """Return the one-sided p-values against a mean of at least `bound`, for an effect of `truth`."""
        return Samples(-self.mean, self.error, self.freedom).p_above(-bound, -truth)


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
    return mean_counts([[graded.grade for graded in one] for one in found])


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

    Seeds are resampled jointly over all parts, so parts depend on each other as in the study. Differences are
    centred by their interquartile mean and moved to a truth. Parts that claim no more than the margin stay at
    zero, where they are true. So do parts without a margin; a claim with such a part cannot be supported.
    Spreads have no differences, so they show nothing (p = 1). `share` is the margin's of the gain.
    """
    truths = {"nothing": 0.0, "the margin": 1.0, "what could be gained": 1 / share}
    sampled = list(resample(claims, draws))
    rows = {}
    for name, size in truths.items():
        grades = [list(grade_samples(samples, size, draws)) for samples in sampled]
        rows[f"moved to {name}"] = mean_counts([list(draw) for draw in zip(*grades, strict=True)])
    return rows


def resample(
    claims: Sequence[Sequence[Finding]], draws: int
) -> Iterator[list[tuple[Finding, Samples | None]]]:
    """Yield the parts of each claim with their resampled differences; spreads have none."""
    seeds = max((one.found.seeds for parts in claims for one in parts), default=1)
    chosen = np.random.default_rng(SEED).integers(0, seeds, (draws, seeds))
    for parts in claims:
        yield [(one, sample(one, chosen) if one.found.differences else None) for one in parts]


def sample(finding: Finding, chosen: NDArray[np.int64]) -> Samples:
    """Centre the differences of a contrast, and resample the chosen seeds, [draws, seeds].

    It computes `statistics.standard_error` for all draws at once.
    """
    differences = np.array(finding.found.differences)
    values = (differences - interquartile_mean(differences))[chosen]
    seeds = values.shape[1]
    cut = int(TRIM * seeds)
    kept, ordered = seeds - 2 * cut, np.sort(values, axis=1)
    winsorised = np.clip(values, ordered[:, cut, None], ordered[:, seeds - cut - 1, None])
    squares = np.sum((winsorised - winsorised.mean(axis=1, keepdims=True)) ** 2, axis=1)
    is_constant = squares < TOLERANCE**2
    plain = np.std(values, axis=1, ddof=1) / np.sqrt(seeds)
    return Samples(
        interquartile_mean(values),
        np.where(is_constant, plain, np.sqrt(squares / (kept * (kept - 1)))),
        np.where(is_constant, seeds - 1, degrees_of_freedom(seeds)),
    )


def grade_samples(
    samples: Sequence[tuple[Finding, Samples | None]], size: float, draws: int
) -> Iterator[Grade]:
    """Yield the grade of a claim in each draw; effects have a size in margins."""
    rows = [p_values(finding, one, size, draws) for finding, one in samples]
    for k in range(draws):
        evidence = [
            Evidence(float(p[k]), float(against[k]), None if small is None else float(small[k]))
            for p, against, small in rows
        ]
        yield grade_claim(evidence, grade_parts(evidence))


def p_values(finding: Finding, samples: Samples | None, size: float, draws: int) -> PValues:
    """Return the p-values of a part in each draw, for an effect of a size in margins."""
    if samples is None:
        return np.ones(draws), np.ones(draws), None
    if finding.found.margin is None:
        return samples.p_above(0.0, 0.0), samples.p_below(0.0, 0.0), None
    if finding.claimed is Claimed.no_more:
        return samples.p_below(finding.found.margin, 0.0), samples.p_above(finding.found.margin, 0.0), None
    truth = size * finding.found.margin
    p, against = samples.p_above(0.0, truth), samples.p_below(0.0, truth)
    return p, against, samples.p_below(finding.found.margin, truth)


def mean_counts(draws: Sequence[Sequence[Grade]]) -> Counts:
    """Return the mean number of claims of each grade over draws."""
    found = [count_grades(grades) for grades in draws]
    return {grade: float(np.mean([count[grade] for count in found])) for grade in Grade}


if __name__ == "__main__":
    main(sys.argv[1:])
