"""What a report opens with: its question, what each arm reached, and how far it is from scratch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ship_trl.config.errors import counted
from ship_trl.files.record import RunRecord
from ship_trl.run.plan import flatten
from ship_trl.study.compare import MIN_SEEDS
from ship_trl.study.metrics import last, mean, measure
from ship_trl.study.plan import SCRATCH, scratch_place
from ship_trl.study.report.curves import cases_of
from ship_trl.study.report.tables import estimate, estimate_cells
from ship_trl.study.statistics import Estimate, estimate_mean
from ship_trl.study.study import Study, pairs, places_of

# Headlines, and arms in a title: more are not named.
MANY = 6


def success(run: RunRecord) -> float:
    """Return the share of the last greedy evaluations that reach the goal, in %.

    Of a suite it is that of the last evaluation's episodes.
    """
    return 100 * (run.final.success_rate if run.final.episodes > 1 else measure(run, "greedy success"))


# What a run reached, by name, with the number of digits shown. Returns are raw; the first is the headline's.
RETURN, SUCCESS = "greedy return", "success (%)"
OUTCOMES: dict[str, tuple[Callable[[RunRecord], float], int]] = {
    RETURN: (lambda run: mean(last(run.greedy.returns)), 1),
    SUCCESS: (success, 0),
    "least distance (m)": (lambda run: measure(run, "least distance"), 0),
    "training return": (lambda run: mean(run.training.returns), 1),
}


@dataclass(frozen=True)
class Reached:
    """The outcomes of an arm of a pair, and their differences from scratch within a seed, by name."""

    pair: str
    cases: str
    arm: str
    seeds: int
    outcomes: dict[str, Estimate | None]
    differences: dict[str, Estimate]

    @property
    def row(self) -> dict[str, Any]:
        """A row of effects.csv."""
        row: dict[str, Any] = {name: getattr(self, name) for name in ("pair", "cases", "arm", "seeds")}
        for name in OUTCOMES:
            row |= estimate_cells(name, self.outcomes[name])
            row |= estimate_cells(f"{name} above scratch", self.differences.get(name))
        return row

    def words(self, name: str, sign: str = "") -> str:
        """Format an outcome with its interval, or with the sign "+" its difference from scratch."""
        found = self.differences[name] if sign else self.outcomes[name]
        return "-" if found is None else found.words(sign, OUTCOMES[name][1])

    @property
    def headline(self) -> str:
        """The differences from scratch in words."""
        found = self.differences[RETURN]
        verdict = "better" if found.low > 0 else "worse" if found.high < 0 else "no difference shown"
        return (
            f"{self.arm} against scratch, {self.cases}, {counted(found.seeds, 'seed')}: {RETURN} "
            f"{self.words(RETURN, '+')}, success {self.words(SUCCESS, '+')} points; "
            f"{verdict if found.seeds >= MIN_SEEDS else 'too few seeds to tell'}"
        )


def measure_arms(study: Study) -> Iterator[Reached]:
    """Yield what each arm of each pair reached, scratch first."""

    def sample(runs: Sequence[RunRecord], name: str) -> Any:
        return np.array([OUTCOMES[name][0](run) for run in runs])

    known = places_of(study)
    for pair in pairs(study):
        for arm, place in sorted(known[pair].items(), key=lambda item: item[0] != SCRATCH):
            runs = [*study.arm(*place).values()]
            both = study.matched({"arm": place, "scratch": scratch_place(*place[:2])})
            compared: Iterable[str] = OUTCOMES if arm != SCRATCH and both["arm"] else ()
            outcomes = {name: estimate(sample(runs, name).tolist()) for name in OUTCOMES}
            differences: dict[str, Estimate] = {}
            for name in compared:
                found = estimate_mean(sample(both["arm"], name) - sample(both["scratch"], name), study.level)
                # As for an arm, few seeds have no interval.
                ends = (found.low, found.high) if found.seeds >= MIN_SEEDS else (np.nan, np.nan)
                differences[name] = replace(found, low=ends[0], high=ends[1])
            yield Reached(pair, cases_of(study, pair), arm, len(runs), outcomes, differences)


def title_of(study: Study) -> str:
    """Return a study's question, or else which arms it compares on which cases."""
    known = places_of(study)
    arms = sorted({arm for pair in pairs(study) for arm in known[pair]} - {SCRATCH})
    compared = ", ".join(arms) if len(arms) <= MANY else f"{len(arms)} arms"
    cases = "; ".join(dict.fromkeys(cases_of(study, pair) for pair in pairs(study)))
    return study.plan.question or f"{compared or 'Nothing'} against scratch: {cases}"


def facts_of(study: Study) -> dict[str, str]:
    """Return what was run, in words, by name."""
    prints = ", ".join(f"{name} ({digest})" for name, digest in study.plan.cases.items())
    facts = {
        "pairs": "; ".join(f"{pair}: {cases_of(study, pair)}" for pair in pairs(study)),
        "arms": ", ".join(sorted({arm for _, _, arm in study.places})),
        "seeds": ", ".join(map(str, sorted({key[3] for key in study.records}))),
        "cases, with fingerprint": prints,
    }
    for key, counts in study.computed().items():
        facts[key] = ", ".join(f"{value} ({count})" for value, count in counts.items())
    # A plan names what is not the paper's.
    settings = {"network": "paper", "algorithm": "double_dqn"} | study.plan.settings
    facts |= {key: str(value) for key, value in flatten(settings)}
    return {key: value for key, value in facts.items() if value}
