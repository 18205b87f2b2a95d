"""The runs of a study by arm and seed, and the looks at which they are judged."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.files.record import RunRecord
from ship_trl.study.claims import NO_CLAIMS, Claims
from ship_trl.study.manifest import NO_PLAN, Plan, load_plan
from ship_trl.study.plan import (
    CONTROLS,
    NEW_CASE,
    PAIRS,
    REUSED,
    SCRATCH,
    SCRATCH_PAIR,
    Place,
    Places,
    scratch_place,
)
from ship_trl.study.statistics import LEVEL
from ship_trl.study.tables import (
    COMPUTED,
    LAYERS,
    NO_PART,
    has_tables,
    read_layers,
    read_runs,
    read_tables,
)

if TYPE_CHECKING:
    import pandas as pd

# The number of seeds between looks, and how many looks there are at most.
BLOCK, MAX_LOOKS = 5, 5

# By part, pair, arm and seed.
Records = dict[tuple[str, str, str, int], RunRecord]


@dataclass(frozen=True)
class Study:
    """The runs of a folder, and the paths that could not be read, with the reason.

    `level` is one-sided, of intervals and tests. `layers` holds similarities of layers, if measured.
    """

    records: Records
    broken: list[tuple[Path, str]] = field(default_factory=list)
    plan: Plan = NO_PLAN
    level: float = LEVEL / 2
    layers: pd.DataFrame | None = None
    claims: Claims = NO_CLAIMS

    @property
    def seeds(self) -> tuple[int, ...]:
        """The judged seeds, in order: those of the plan, or all if there is no plan."""
        return self.plan.seeds or tuple(sorted({key[3] for key in self.records}))

    @property
    def looks(self) -> tuple[int, ...]:
        """The numbers of seeds at which the study is judged: every five (more for many seeds), and all."""
        count = len(self.seeds)
        step = max(BLOCK, -(-count // MAX_LOOKS))
        return (*range(step, count, step), count)

    @property
    def whole_looks(self) -> tuple[int, ...]:
        """The looks whose seeds all have runs, and always the first look."""
        begun = {key[3] for key in self.records}
        first, *others = self.looks
        return (first, *(count for count in others if begun.issuperset(self.seeds[:count])))

    def first(self, count: int, level: float) -> Study:
        """Return the study of the first `count` seeds, with another level."""
        seeds = set(self.seeds[:count])
        kept = {key: record for key, record in self.records.items() if key[3] in seeds}
        layers = None if self.layers is None else self.layers[self.layers["seed"].isin(seeds)]
        return replace(self, records=kept, layers=layers, level=level)

    def scored(self) -> Study:
        """Return the study of the runs whose returns make scores."""
        kept = {key: one for key, one in self.records.items() if one.best_known_return is not None}
        return replace(self, records=kept)

    def arm(self, part: str, pair: str, arm: str) -> dict[int, RunRecord]:
        """Return the runs of an arm by seed."""
        return self._by_place.get((part, pair, arm), {})

    @property
    def places(self) -> list[Place]:
        """The places of all arms, sorted."""
        return list(self._by_place)

    @cached_property
    def _by_place(self) -> dict[Place, dict[int, RunRecord]]:
        places: dict[Place, dict[int, RunRecord]] = defaultdict(dict)
        for (part, pair, arm, seed), record in sorted(self.records.items()):
            places[part, pair, arm][seed] = record
        return places

    def computed(self) -> dict[str, dict[str, int]]:
        """Count the runs by version, torch, device, precision, backend and processor."""
        found: dict[str, Counter[str]] = defaultdict(Counter)
        for record in self.records.values():
            for key in COMPUTED:
                found[key][str(getattr(record, key))] += 1
        return {key: dict(sorted(counts.items())) for key, counts in found.items()}

    def cases(self, pair: str) -> tuple[str | None, str]:
        """Return source and target of a pair; no source if all its runs are from scratch."""
        runs = [run for key, run in sorted(self.records.items()) if key[:2] == (PAIRS, pair)]
        return next((run.source for run in runs if run.source), None), runs[0].target

    def matched(self, places: Places) -> dict[str, list[RunRecord]]:
        """Return the runs of some arms, by name, for the seeds that all of them have."""
        runs = {name: self.arm(*place) for name, place in places.items()}
        seeds = sorted(set.intersection(*(set(by_seed) for by_seed in runs.values())) if runs else set())
        return {name: [by_seed[seed] for seed in seeds] for name, by_seed in runs.items()}


def read_study(folder: Path, claims: Claims = NO_CLAIMS) -> Study:
    """Read a study from its tables, or else from the runs below a folder."""
    broken: list[tuple[Path, str]] = []
    found = read_tables(folder)[1] if has_tables(folder) else read_runs(folder, broken)
    records = {(*one.place, one.seed): one for one in found}
    layers = layers_of(folder, records, broken)
    return Study(records, broken, load_plan(folder), layers=layers, claims=claims)


def finished_study(folder: Path, seeds: int | None = None, claims: Claims = NO_CLAIMS) -> Study:
    """Read a study with a finished run, or its first `seeds`; name runs that cannot be read on stderr."""
    study = read_study(folder, claims)
    if seeds is not None:
        if not 1 <= seeds <= len(study.seeds):
            raise ConfigError(f"--seeds: must be from 1 to {len(study.seeds)}, as planned, got {seeds}")
        study = study.first(seeds, study.level)
    if not study.records and study.broken and all(reason.endswith(NO_PART) for _, reason in study.broken):
        raise ConfigError(f"folder: {folder} has runs but no study; python -m ship_trl results lists them")
    for path, reason in study.broken:
        print_error(f"{path}: {reason}; left out")
    if not study.records:
        raise ConfigError(f"folder: no finished run below {folder}; python -m ship_trl study run makes some")
    return study


def layers_of(folder: Path, records: Records, broken: list[tuple[Path, str]]) -> pd.DataFrame | None:
    """Return a folder's layer similarities of these runs; add to `broken` what is left out."""
    path = folder / LAYERS
    if not path.exists():
        return None
    try:
        table = read_layers(path)
    except ConfigError as error:
        broken.append((path, str(error).removeprefix(f"table: {path} ")))
        return None
    kept = table[[(PAIRS, row.pair, row.arm, row.seed) in records for row in table.itertuples()]]
    if missing := len(table) - len(kept):
        broken.append((path, f"{missing} of {len(table)} rows are of missing runs"))
    return kept


def pairs(study: Study) -> list[str]:
    """Return the pairs of a study, sorted."""
    return sorted({pair for part, pair, _ in study.places if part == PAIRS})


def places_of(study: Study) -> dict[str, dict[str, Place]]:
    """Return the places of all arms, by pair, or by "source to target" for a control pair.

    The arms of a pair include its controls; those of a control pair include scratch on its target. The arms
    of the new case have the names of `REUSED`.
    """
    found: dict[str, dict[str, Place]] = {}
    for kind in (PAIRS, CONTROLS):
        for part, label, arm in study.places:
            if part == kind and not (part == CONTROLS and label in SCRATCH_PAIR):
                found.setdefault(label, {})[arm] = (part, label, arm)
    for label in SCRATCH_PAIR:
        own: dict[str, Place] = {place[2]: place for place in study.places if place[:2] == (CONTROLS, label)}
        if own:
            run = next(iter(study.arm(*next(iter(own.values()))).values()))
            scratch = scratch_place(CONTROLS, label)
            base: dict[str, Place] = {SCRATCH: scratch} if study.arm(*scratch) else {}
            found[f"{run.source} to {run.target}"] = base | own
    reused = {name: place for name, place in REUSED.items() if study.arm(*place)}
    return {**found, NEW_CASE: reused} if reused else found
