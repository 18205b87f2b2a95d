"""`python -m ship_trl.study.calibration`: how often the study's rules err where the truth is known.

Every row simulates numbers by seed for arms whose truth is given, judges them by the rules of the
study, and counts the verdicts that are wrong.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from rich.console import Console
from rich.table import Table

from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import print_error
from ship_trl.study.analysis.contrasts import Claimed, Verdict, contrast
from ship_trl.study.analysis.statistics import LEVEL, Sample, look_level, spread_test
from ship_trl.study.analysis.study import BLOCK, Study
from ship_trl.study.claims.kinds import Hypothesis, Test
from ship_trl.study.claims.verdicts import judge

SEEDS = (BLOCK, 2 * BLOCK, 3 * BLOCK)
REPEATS = 2000
SD, MARGIN = 0.1, 0.05
# Of arms that fall back into colliding: how often, and what it costs of a score.
COLLAPSE, COST = 0.2, 0.5
# Claims of a figure, and contrasts of each: about those of figure 5.
CLAIMS, CONTRASTS = 11, 4
Sampler = Callable[[np.random.Generator, int], Sample]
Wrong = Callable[[np.random.Generator, int], bool]
NOTHING = Study({})


@dataclass(frozen=True)
class Row:
    """What is tried, the share of wrong verdicts that the rules allow, and the share by seeds.

    None is allowed where the truth is a difference, of a kind that should not decide levels.
    """

    what: str
    allowed: float | None
    shares: dict[int, float]


def normal(sd: float = SD, mean: float = 0.0) -> Sampler:
    """Draw an arm whose seeds are normal."""
    return lambda rng, count: rng.normal(mean, sd, count)


def skewed(sd: float = SD) -> Sampler:
    """Draw an arm with a long tail on one side, and a mean of zero."""
    return lambda rng, count: sd * (1.0 - rng.exponential(1.0, count))


def bounded(rng: np.random.Generator, count: int) -> Sample:
    """Draw an arm with no tails, as times that are cut off at a run's end have none."""
    return rng.uniform(-SD, SD, count)


def collapsing(sampler: Sampler) -> Sampler:
    """Draw an arm that collapses in some seeds."""
    return lambda rng, count: sampler(rng, count) - COST * (rng.random(count) < COLLAPSE)


def claim(name: str, *contrasts: Sample, claimed: Claimed = Claimed.above) -> Hypothesis:
    """Make a claim whose contrasts are these differences by seed."""

    def test(values: Sample) -> Test:
        return lambda study, claim: [contrast(claim, "", "area", values, MARGIN, claimed, study.level)]

    return Hypothesis(name, "simulated", "", [test(values) for values in contrasts])


def verdicts(claims: Sequence[Hypothesis], count: int, level: float = LEVEL / 2) -> set[Verdict]:
    """Judge a figure of claims by the rules of the study."""
    return {found.verdict for found in judge(NOTHING, claims, count, level)}


DIFFERENT = {Verdict.supported, Verdict.contradicted}


def pair(one: Sampler, other: Sampler, among: set[Verdict] = DIFFERENT) -> Wrong:
    """Say whether two arms are said to differ, or the one to be above the other (supported) or below it."""
    return lambda rng, count: bool(verdicts([claim("A", one(rng, count) - other(rng, count))], count) & among)


def called(verdict: Verdict, difference: float, claimed: Claimed = Claimed.above) -> Wrong:
    """Say whether arms that differ so much, and vary little, get this verdict."""
    arm = normal(SD / 10, difference)

    def wrong(rng: np.random.Generator, count: int) -> bool:
        differences = arm(rng, count) - normal(SD / 10)(rng, count)
        return verdict in verdicts([claim("A", differences, claimed=claimed)], count)

    return wrong


def conjunction(rng: np.random.Generator, count: int) -> bool:
    """Say whether a claim of four contrasts is supported of which three are surely true and one is not."""
    true = [normal(mean=5 * SD)(rng, count) for _ in range(3)]
    return Verdict.supported in verdicts([claim("A", *true, normal()(rng, count))], count)


def figure(sampler: Sampler, looks: bool, contrasts: int = 1) -> Wrong:
    """Say whether any claim of a figure is decided whose arms are all like scratch, at any look."""

    def wrong(rng: np.random.Generator, count: int) -> bool:
        scratch = sampler(rng, count)
        arms = [[sampler(rng, count) - scratch for _ in range(contrasts)] for _ in range(CLAIMS)]
        ends = list(range(BLOCK, count + 1, BLOCK)) if looks else [count]
        for number, end in enumerate(ends, 1):
            claims = [claim(str(k), *(values[:end] for values in arm)) for k, arm in enumerate(arms)]
            if verdicts(claims, end, look_level(number, len(ends))) & DIFFERENT:
                return True
        return False

    return wrong


def curves(rng: np.random.Generator, count: int, local: bool, mean: float, collapse: bool) -> Sample:
    """Draw curves by seed [count, T] whose spread along the curve is the same however they vary.

    Seeds differ along the whole curve, or each place by itself (`local`); some may collapse half-way.
    """
    places = np.linspace(0, 1, 20)
    differ = rng.normal(size=(count, 20) if local else (count, 1)) * np.ones(20)
    fallen = (rng.random((count, 1)) < COLLAPSE) * (places > 0.5) * collapse
    return mean * places + SD * differ - COST * fallen


def spreads(
    local: tuple[bool, bool], mean: float = 0.0, collapse: bool = False, said: tuple[int, ...] = (0, 1)
) -> Wrong:
    """Say whether two arms of equal spread are `said` to vary differently: the first (0) or second less."""

    def wrong(rng: np.random.Generator, count: int) -> bool:
        one, other = (
            curves(rng, count, how, level, collapse) for how, level in zip(local, (0, mean), strict=True)
        )
        _, *p = spread_test(one, other, seed=0, resamples=256)
        return min(p[which] for which in said) <= LEVEL / 2

    return wrong


TRIED: tuple[tuple[str, float | None, Wrong], ...] = (
    ("two arms alike, spreads equal: said to differ", LEVEL, pair(normal(), normal())),
    ("two arms alike, spreads 1 to 3", LEVEL, pair(normal(), normal(3 * SD))),
    (
        "two arms alike, each collapses in a fifth of its seeds",
        LEVEL,
        pair(collapsing(normal()), collapsing(normal())),
    ),
    ("two arms alike, but one collapses in a fifth", None, pair(normal(), collapsing(normal()))),
    ("two arms of equal mean, one with a long tail", LEVEL, pair(normal(), skewed())),
    ("two arms alike, without tails", LEVEL, pair(bounded, bounded)),
    ("a claim of four contrasts, one of them null: supported", LEVEL / 2, conjunction),
    ("a figure of 11 claims, arms like scratch: any decided", LEVEL, figure(normal(), looks=False)),
    ("the same, looked at after every five seeds", LEVEL, figure(normal(), looks=True)),
    ("the same, without tails", LEVEL, figure(bounded, looks=True)),
    ("the same, four contrasts a claim", LEVEL, figure(normal(), looks=True, contrasts=CONTRASTS)),
    ("arms that differ by the margin: equivalent", LEVEL / 2, called(Verdict.equivalent, MARGIN)),
    ("the same: no more", LEVEL / 2, called(Verdict.supported, MARGIN, Claimed.no_more)),
    ("the same: no more contradicted", LEVEL / 2, called(Verdict.contradicted, MARGIN, Claimed.no_more)),
    ("spreads alike: said to vary differently", LEVEL, spreads((False, False))),
    ("spreads alike, levels not", LEVEL, spreads((False, False), mean=0.3)),
    ("spreads alike, some seeds collapse", LEVEL, spreads((False, False), collapse=True)),
    ("spreads alike, whole curves differ or each place by itself", LEVEL, spreads((False, True))),
    # One side of what errs more on it than on the other; beside the plan's table, and written after it.
    ("one with a long tail: said to be better", LEVEL / 2, pair(skewed(), normal(), {Verdict.supported})),
    ("spreads alike: whole curves said to vary less", LEVEL / 2, spreads((False, True), said=(0,))),
)


def calibrate(
    repeats: int = REPEATS, tried: Sequence[tuple[str, float | None, Wrong]] = TRIED
) -> Iterator[Row]:
    """Try everything, at each number of seeds."""
    for what, allowed, wrong in tried:
        shares = {}
        for count in SEEDS:
            rng = np.random.default_rng([count, len(what)])
            shares[count] = sum(wrong(rng, count) for _ in range(repeats)) / repeats
        yield Row(what, allowed, shares)


def main(arguments: list[str] | None = None) -> None:
    """Print the table."""
    parser = make_parser("calibration", __doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS, help=f"simulations a row, default {REPEATS}")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        print_error(f"--repeats: must be at least 1, got {options.repeats}")
        sys.exit(1)
    table = Table("tried", "allowed", *(f"{count} seeds" for count in SEEDS))
    for row in calibrate(options.repeats):
        allowed = "-" if row.allowed is None else f"{row.allowed:.1%}"
        table.add_row(row.what, allowed, *(f"{share:.1%}" for share in row.shares.values()))
    Console(highlight=False).print(table)
    varies = 1.96 * sqrt(LEVEL * (1 - LEVEL) / options.repeats)
    Console(highlight=False).print(
        f"{options.repeats} simulations each: chance moves a share of 5 % by {varies:.1%}."
    )


if __name__ == "__main__":
    main()
