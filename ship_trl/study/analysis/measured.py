"""A study's runs by arm and seed, and the kinds of contrast that are measured on them."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.study.analysis.contrasts import Claimed, Finding, contrast
from ship_trl.study.analysis.manifest import PLAN
from ship_trl.study.analysis.metrics import TIMES, curve, measure, reached
from ship_trl.study.analysis.records import BrokenRunError, Record, find_runs, read_placed
from ship_trl.study.analysis.statistics import LEVEL, OBRIEN_FLEMING, SWAPS, Sample, level_of, spread_test
from ship_trl.study.margins import margin
from ship_trl.study.plan.jobs import PAIRS, PARTS

# Of all resampling: the same study gives the same report.
SEED = 2022
# So many seeds are run before the study is looked at again (docs/analysis-plan.md).
BLOCK, MOST_LOOKS = 5, len(OBRIEN_FLEMING)
# Times of arms can be called equal if at least this share of the runs of each got there.
REACHED = 0.75
# What stands beside a metric to show whether the choice of it decides.
SENSITIVITY = {
    "area": ("greedy area",),
    "asymptote": ("greedy asymptote",),
    "time": ("time to 0.5", "time to 0.8"),
}

Records = dict[tuple[str, str, str, int], Record]
Places = Mapping[str, tuple[str, str, str]]


@dataclass(frozen=True)
class Study:
    """The runs of a folder.

    `broken` are those that could not be read, with the reason. `planned` are the seeds that the study was
    begun with: they alone are judged, however many are run later; all that are there where no plan is
    known. `rules` name the plan (see `rules.py`). `level` is one-sided, of intervals and tests; `resamples`
    how often arms change places to test spreads.
    """

    records: Records
    broken: list[tuple[Path, str]] = field(default_factory=list)
    planned: tuple[int, ...] = ()
    rules: dict[str, Any] = field(default_factory=dict)
    level: float = LEVEL / 2
    resamples: int = SWAPS

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds that are looked at, in order."""
        return self.planned or tuple(sorted({key[3] for key in self.records}))

    @property
    def looks(self) -> tuple[int, ...]:
        """After how many seeds the study is looked at: each five (or fifth of many), and at the end."""
        count = len(self.seeds)
        step = max(BLOCK, -(-count // MOST_LOOKS))
        return (*range(step, count, step), count)

    def first(self, count: int, level: float) -> Study:
        """Return the runs of the first `count` seeds, to be judged at a level."""
        seeds = set(self.seeds[:count])
        kept = {key: record for key, record in self.records.items() if key[3] in seeds}
        return replace(self, records=kept, level=level)

    def arm(self, part: str, pair: str, arm: str) -> dict[int, Record]:
        """Return the runs of an arm by seed."""
        return self._by_place.get((part, pair, arm), {})

    @cached_property
    def _by_place(self) -> dict[tuple[str, str, str], dict[int, Record]]:
        places: dict[tuple[str, str, str], dict[int, Record]] = defaultdict(dict)
        for (*place, seed), record in sorted(self.records.items()):
            places[tuple(place)][seed] = record  # type: ignore[index]
        return places

    def mixed(self) -> dict[str, dict[str, int]]:
        """Count by what runs were computed where they differ: by version, device, precision."""
        found: dict[str, Counter[str]] = defaultdict(Counter)
        for record in self.records.values():
            for key, value in record.computed.items():
                found[key][value] += 1
        return {key: dict(sorted(counts.items())) for key, counts in found.items() if len(counts) > 1}

    def cases(self, pair: str) -> tuple[str | None, str]:
        """Return source and target of a pair, by its runs; only those from scratch have no source."""
        runs = [r for (part, name, _, _), r in sorted(self.records.items()) if (part, name) == (PAIRS, pair)]
        source = next((r.source for r in runs if r.source), None)
        return source, runs[0].target

    def together(self, places: Places) -> dict[str, list[Record]]:
        """Return runs by name, of the seeds that all of these (part, pair, arm) have, in order."""
        runs = {name: self.arm(*place) for name, place in places.items()}
        seeds = sorted(set.intersection(*(set(by_seed) for by_seed in runs.values())) if runs else set())
        return {name: [by_seed[seed] for seed in seeds] for name, by_seed in runs.items()}


def read_study(folder: Path) -> Study:
    """Read all runs below a folder; what cannot be read, or is no study's, is named in `broken`."""
    planned, rules = begun_with(folder)
    study = Study({}, planned=planned, rules=rules)
    for path, part in find_runs(folder):
        try:
            if part not in PARTS:
                raise BrokenRunError(f"{part or folder} is no part of a study")
            record = read_placed(path, part)
        except BrokenRunError as error:
            study.broken.append((path, str(error)))
            continue
        study.records[part, record.pair, record.arm, record.seed] = record
    return replace(study, records=same_zero(study.records))


def begun_with(folder: Path) -> tuple[tuple[int, ...], dict[str, Any]]:
    """Return the seeds and the rules that a study was begun with; nothing where there is no plan to read."""
    try:
        plan = json.loads((folder / PLAN).read_text())
        seeds = plan.get("judged") or {job["seed"] for job in plan["jobs"] if job["part"] == PAIRS}
        rules = plan.get("rules", {})
        known = {key: rules[key] for key in ("digest", "commit", "begun")} if rules else {}
        return tuple(sorted(map(int, seeds))), known
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return (), {}


def same_zero(records: Records) -> Records:
    """Give all runs of a case one zero of the score; those of older programs have each drawn their own."""
    drawn: dict[str, list[float]] = {}
    for record in records.values():
        drawn.setdefault(record.target, []).append(record.random)
    return {key: replace(r, random=float(np.median(drawn[r.target]))) for key, r in records.items()}


def levels(
    study: Study,
    claim: str,
    what: str,
    places: Places,
    weights: Mapping[str, float],
    metric: str,
    claimed: Claimed = Claimed.above,
) -> list[Finding]:
    """Measure a weighted sum of arms within each seed, above zero or what else is claimed.

    Nothing where there are less than two seeds that all arms have.
    """
    runs = study.together(places)
    if min(map(len, runs.values()), default=0) < 2:
        return []

    def differences(of: str) -> Sample:
        parts = [share * np.array([measure(r, of) for r in runs[name]]) for name, share in weights.items()]
        return np.sum(parts, axis=0)

    bound = margin(next(iter(runs.values()))[0].target, metric)
    if metric in TIMES and any(np.mean([reached(r) for r in records]) < REACHED for records in runs.values()):
        # Runs that are cut off at their end are not alike because their times are.
        bound = None
    found = contrast(claim, f"{what} ({metric})", metric, differences(metric), bound, claimed, study.level)
    beside = {name: level_of(differences(name), study.level) for name in SENSITIVITY.get(metric, ())}
    return [replace(found, beside=beside)]


def steadier(study: Study, claim: str, where: str, places: Places, steady: str, other: str) -> list[Finding]:
    """Measure how much less one arm's curves vary over seeds than another's (see `spread_test`)."""
    runs = study.together(places)
    if min(map(len, runs.values())) < 2:
        return []
    curves = {name: np.stack([curve(record) for record in runs[name]]) for name in (steady, other)}
    estimate, p, against = spread_test(curves[steady], curves[other], SEED, study.level, study.resamples)
    what = f"{where}: {steady} varies less than {other} (spread; logarithm of the ratio)"
    return [Finding(claim, what, "spread", estimate, p, against, seeds=len(curves[steady]))]
