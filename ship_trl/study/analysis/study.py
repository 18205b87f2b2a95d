"""A study's runs by arm and seed, and after which seeds they are looked at."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.study.analysis.statistics import LEVEL, OBRIEN_FLEMING, SWAPS
from ship_trl.study.plan.jobs import PAIRS
from ship_trl.study.plan.manifest import begun_with, warmup_of
from ship_trl.study.records.layers import LAYERS, Layer, read_layers
from ship_trl.study.records.record import COMPUTED, NO_PART, Record, read_runs
from ship_trl.study.records.tables import has_tables, read_tables

# So many seeds are run before the study is looked at again (docs/analysis-plan.md).
BLOCK, MOST_LOOKS = 5, len(OBRIEN_FLEMING)

Records = dict[tuple[str, str, str, int], Record]
# Part, pair and arm.
Place = tuple[str, str, str]
Places = Mapping[str, Place]


@dataclass(frozen=True)
class Study:
    """The runs of a folder.

    `broken` are those that could not be read, with the reason. `planned` are the seeds that the study was
    begun with: they alone are judged, however many are run later; all that are there where no plan is
    known. `rules` name the plan (see `rules.py`). `level` is one-sided, of intervals and tests; `resamples`
    how often arms change places to test spreads. `layers` say how alike those of networks are, where that
    was measured. No run learns before `warmup` episodes are over.
    """

    records: Records
    broken: list[tuple[Path, str]] = field(default_factory=list)
    planned: tuple[int, ...] = ()
    rules: dict[str, Any] = field(default_factory=dict)
    level: float = LEVEL / 2
    resamples: int = SWAPS
    layers: list[Layer] = field(default_factory=list)
    warmup: int = 0

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
        layers = [row for row in self.layers if row.seed in seeds]
        return replace(self, records=kept, layers=layers, level=level)

    def arm(self, part: str, pair: str, arm: str) -> dict[int, Record]:
        """Return the runs of an arm by seed."""
        return self._by_place.get((part, pair, arm), {})

    @cached_property
    def _by_place(self) -> dict[tuple[str, str, str], dict[int, Record]]:
        places: dict[tuple[str, str, str], dict[int, Record]] = defaultdict(dict)
        for (*place, seed), record in sorted(self.records.items()):
            places[tuple(place)][seed] = record  # type: ignore[index]
        return places

    def computed(self) -> dict[str, dict[str, int]]:
        """Count by what the runs were computed: version, torch, device, precision, backend, processor."""
        found: dict[str, Counter[str]] = defaultdict(Counter)
        for record in self.records.values():
            for key, value in record.computed.items():
                found[key][value] += 1
        return {key: dict(sorted(found[key].items())) for key in COMPUTED if found[key]}

    def cases(self, pair: str) -> tuple[str | None, str]:
        """Return source and target of a pair, by its runs; only those from scratch have no source."""
        runs = [r for (part, name, _, _), r in sorted(self.records.items()) if (part, name) == (PAIRS, pair)]
        source = next((r.source for r in runs if r.source), None)
        return source, runs[0].target

    def matched(self, places: Places) -> dict[str, list[Record]]:
        """Return runs by name, of the seeds that all of these (part, pair, arm) have, in order."""
        runs = {name: self.arm(*place) for name, place in places.items()}
        seeds = sorted(set.intersection(*(set(by_seed) for by_seed in runs.values())) if runs else set())
        return {name: [by_seed[seed] for seed in seeds] for name, by_seed in runs.items()}


def read_study(folder: Path) -> Study:
    """Read a study from its tables, where the folder has them, or else from the runs below it.

    Runs that cannot be read, or are no study's, are named in `broken`.

    Raises:
        ConfigError: tables that are not whole.
    """
    broken: list[tuple[Path, str]] = []
    found = read_tables(folder).by_run() if has_tables(folder) else read_runs(folder, broken)
    records = {(one.part, one.pair, one.arm, one.seed): one for one, _, _ in found}
    planned, rules = begun_with(folder)
    layers, warmup = layers_of(folder, records, broken), warmup_of(folder)
    return Study(same_zero(records), broken, planned, rules, layers=layers, warmup=warmup)


def finished_study(folder: Path, seeds: int | None = None) -> Study:
    """Read a study to show it, or its first `seeds`; what cannot be read is named on stderr, and left out.

    Raises:
        ConfigError: there is no finished run, the tables are not whole, or there are not so many seeds.
    """
    study = read_study(folder)
    if seeds is not None:
        if not 1 <= seeds <= len(study.seeds):
            raise ConfigError(
                f"--seeds: must be from 1 to {len(study.seeds)}, which it was begun with, got {seeds}"
            )
        study = study.first(seeds, study.level)
    if not study.records and study.broken and all(reason.endswith(NO_PART) for _, reason in study.broken):
        raise ConfigError(f"folder: the runs below {folder} are of no study; ship_trl.results tables them")
    for path, reason in study.broken:
        print_error(f"{path}: {reason}; left out")
    if not study.records:
        raise ConfigError(f"folder: no finished run below {folder}; python -m ship_trl study makes some")
    return study


def layers_of(folder: Path, records: Records, broken: list[tuple[Path, str]]) -> list[Layer]:
    """Return the rows about layers that a folder has of these runs; what is left out is named in `broken`."""
    path = folder / LAYERS
    if not path.exists():
        return []
    try:
        rows = read_layers(path)
    except ConfigError as error:
        broken.append((path, str(error).removeprefix(f"table: {path} ")))
        return []
    kept = [row for row in rows if (PAIRS, row.pair, row.arm, row.seed) in records]
    if others := len(rows) - len(kept):
        broken.append((path, f"{others} of {len(rows)} rows are of runs that are not there"))
    return kept


def same_zero(records: Records) -> Records:
    """Give all runs of a case one zero of the score; those of older programs have each drawn their own."""
    drawn: dict[str, list[float]] = {}
    for record in records.values():
        drawn.setdefault(record.target, []).append(record.random)
    return {key: replace(r, random=float(np.median(drawn[r.target]))) for key, r in records.items()}
