"""`python -m ship_trl.study.calibration`: how often the study's rules err where the truth is known.

Every row simulates numbers by seed for arms whose truth is given, judges them by the rules of the
study, and counts the verdicts that are wrong.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import sqrt

import numpy as np
from rich.console import Console
from rich.table import Table

from ship_trl.cli import complain, make_parser
from ship_trl.study.statistics import (
    LEVEL,
    Sample,
    holm,
    look_level,
    p_above,
    p_below,
    p_within,
    spread_test,
)

SEEDS, BLOCK = (5, 10, 15), 5
REPEATS = 2000
SD, MARGIN = 0.1, 0.05
# Of arms that fall back into colliding: how often, and what it costs of a score.
COLLAPSE, COST = 0.2, 0.5
Draw = Callable[[np.random.Generator, int], Sample]


@dataclass(frozen=True)
class Row:
    """What is tried, the share of wrong verdicts that the rules allow, and the share by seeds.

    None is allowed where the truth is a difference, of a kind that should not decide levels.
    """

    what: str
    allowed: float | None
    shares: dict[int, float]


def normal(sd: float = SD, mean: float = 0.0) -> Draw:
    """Draw an arm whose seeds are normal."""
    return lambda rng, count: rng.normal(mean, sd, count)


def skewed(sd: float = SD) -> Draw:
    """Draw an arm with a long tail on one side, and a mean of zero."""
    return lambda rng, count: sd * (1.0 - rng.exponential(1.0, count))


def collapsing(draw: Draw) -> Draw:
    """Draw an arm that collapses in some seeds."""
    return lambda rng, count: draw(rng, count) - COST * (rng.random(count) < COLLAPSE)


def differs(differences: Sample, level: float = LEVEL / 2) -> bool:
    """Judge a contrast of two arms: are they said to differ?"""
    return min(p_above(differences), p_below(differences)) <= level


def pair(one: Draw, other: Draw) -> Callable[[np.random.Generator, int], bool]:
    """Say whether two arms are said to differ."""
    return lambda rng, count: differs(one(rng, count) - other(rng, count))


def equal(difference: float) -> Callable[[np.random.Generator, int], bool]:
    """Say whether arms that differ so much are called equivalent."""
    steady = SD / 10  # so that it can be decided
    return lambda rng, count: (
        p_within(normal(steady, difference)(rng, count) - normal(steady)(rng, count), MARGIN) <= LEVEL / 2
    )


def looks(rng: np.random.Generator, count: int) -> bool:
    """Say whether arms that are alike are said to differ at any look."""
    values = normal()(rng, count) - normal()(rng, count)
    ends = range(BLOCK, count + 1, BLOCK)
    return any(differs(values[:end], look_level(k, len(ends))) for k, end in enumerate(ends, 1))


def conjunction(rng: np.random.Generator, count: int) -> bool:
    """Say whether a claim of four contrasts is supported of which three are surely true and one is not."""
    true = [normal(mean=5 * SD)(rng, count) for _ in range(3)]
    return max(p_above(values) for values in (*true, normal()(rng, count))) <= LEVEL / 2


def figure(rng: np.random.Generator, count: int) -> bool:
    """Say whether any of a figure's nine arms, all like scratch, is said to differ from it."""
    scratch = normal()(rng, count)
    arms = [normal()(rng, count) - scratch for _ in range(9)]
    support, against = (holm([test(values) for values in arms]) for test in (p_above, p_below))
    return min(*support, *against) <= LEVEL / 2


def curves(rng: np.random.Generator, count: int, spread: Sample | float, mean: float) -> Sample:
    """Draw curves by seed whose seeds differ all along the curve: [count, T]."""
    places = np.linspace(0, 1, 20)
    return (
        mean * places
        + spread * rng.normal(size=(count, 1)) * places
        + 0.3 * SD * rng.normal(size=(count, len(places)))
    )


def spreads(sd: float, mean: float) -> Callable[[np.random.Generator, int], bool]:
    """Say whether two arms whose spreads are alike, and levels perhaps not, are said to vary differently."""

    def wrong(rng: np.random.Generator, count: int) -> bool:
        one, other = curves(rng, count, sd, 0.5), curves(rng, count, sd, 0.5 + mean)
        _, steadier, wilder = spread_test(one, other, seed=0, resamples=400)
        return min(steadier, wilder) <= LEVEL / 2

    return wrong


TRIED: tuple[tuple[str, float | None, Callable[[np.random.Generator, int], bool]], ...] = (
    ("two arms alike, spreads equal: said to differ", LEVEL, pair(normal(), normal())),
    ("two arms alike, spreads 1 to 3: said to differ", LEVEL, pair(normal(), normal(3 * SD))),
    ("two arms alike, each collapses in a fifth of its seeds", LEVEL, pair(*[collapsing(normal())] * 2)),
    ("two arms alike but that one collapses in a fifth", None, pair(normal(), collapsing(normal()))),
    ("two arms of equal mean, one with a long tail", LEVEL, pair(normal(), skewed())),
    ("looks after every five seeds, arms alike", LEVEL, looks),
    ("a claim of four contrasts, one of them null: supported", LEVEL / 2, conjunction),
    ("nine arms like scratch, Holm: any said to differ", LEVEL, figure),
    ("arms that differ by the margin: called equivalent", LEVEL / 2, equal(MARGIN)),
    ("arms that differ by the margin and a half: equivalent", LEVEL / 2, equal(1.5 * MARGIN)),
    ("spreads alike, levels alike: said to vary differently", LEVEL, spreads(SD, 0.0)),
    ("spreads alike, levels not: said to vary differently", LEVEL, spreads(SD, 0.3)),
)


def calibrate(repeats: int = REPEATS) -> Iterator[Row]:
    """Try everything, at each number of seeds."""
    for what, allowed, wrong in TRIED:
        shares = {}
        for count in SEEDS:
            rng = np.random.default_rng([count, len(what)])
            shares[count] = sum(wrong(rng, count) for _ in range(repeats)) / repeats
        yield Row(what, allowed, shares)


def main(arguments: list[str] | None = None) -> None:
    """Print the table."""
    parser = make_parser("ship_trl.study.calibration", __doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS, help=f"simulations a row, default {REPEATS}")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        complain(f"--repeats: must be at least 1, got {options.repeats}")
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
