"""Tables of a study, written as CSV, and of any runs: a row for each run, arm, transfer, layer or pair."""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ship_trl.config.arm import SCRATCH, Arm, SourceWeights
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_files
from ship_trl.files.disk import atomic_write
from ship_trl.files.record import RunRecord
from ship_trl.sim.cases import load_case, load_world
from ship_trl.study import compare
from ship_trl.study.compare import MIN_SEEDS, SEED, gain
from ship_trl.study.metrics import METRICS, THRESHOLDS, has_reached, measure, metrics_of
from ship_trl.study.plan import (
    ALONE,
    LOW,
    LOW_EPSILON,
    ONE,
    PARTS,
    REUSED_CASE,
    Place,
    read_pair,
    scratch_place,
)
from ship_trl.study.statistics import LEVEL, Estimate, Sample, bootstrap, interquartile_mean, share_interval
from ship_trl.study.study import Study, pairs
from ship_trl.study.tables import LAYER_NAMES, read_groups
from ship_trl.study.transfers import COLUMNS
from ship_trl.transfer.similarity import ALPHA, BETA, describe_similarity, similarity

Row = dict[str, Any]
# A column of arms.csv, as the metrics in `LATER`.
FORWARD = "forward transfer"
EQUATION = f"{ALPHA:g} common / ({ALPHA:g} common + {BETA:g} different)"


def run_rows(study: Study) -> list[Row]:
    """Return every metric of every run."""
    rows, names = [], metrics_of(study.records.values())
    for (part, pair, arm, seed), record in sorted(study.records.items()):
        row: Row = {"part": part, "pair": pair, "arm": arm, "seed": seed}
        row |= {name: measure(record, name) for name in names}
        rows.append(row | {"reached": has_reached(record)})
    return rows


def arm_rows(study: Study) -> list[Row]:
    """Return every metric of every arm, as interquartile mean over seeds with its interval."""
    rows, names = [], metrics_of(study.records.values())
    for place in study.places:
        part, pair, arm = place
        runs = list(study.arm(*place).values())
        row: Row = {"part": part, "pair": pair, "arm": arm, "seeds": len(runs)}
        for name in names:
            row |= estimate_cells(name, estimate([measure(run, name) for run in runs]))
        areas = [measure(run, "area") for run in runs]
        row["area deviation"] = float(np.std(areas, ddof=1)) if len(runs) > 1 else ""
        has_scores = bool(np.isfinite(areas).all())
        row["reached"] = sum(map(has_reached, runs)) if has_scores else ""
        # A share of runs needs another interval.
        fallen = sum(int(measure(run, "fell")) for run in runs)
        row |= estimate_cells("fell", share_interval(fallen, len(runs)))
        # Those of the seeds that the arm shares with scratch.
        scratch = scratch_place(part, pair) if part in PARTS else (part, pair, SCRATCH.name)
        both = study.matched({"arm": place, "scratch": scratch})
        own, base = (np.array([measure(run, "area") for run in both[name]]) for name in ("arm", "scratch"))
        is_transfer = arm != SCRATCH.name
        has_ratio = is_transfer and has_scores and len(own) >= MIN_SEEDS
        ratio = bootstrap([own, base], area_ratio, SEED) if has_ratio else None
        row |= estimate_cells("transfer ratio", ratio)
        forward = compare.forward_transfer(own, base, paired=True) if is_transfer and len(own) else None
        row |= estimate_cells(FORWARD, forward if forward and np.isfinite(forward.value) else None)
        rows.append(row)
    return rows


def area_ratio(own: Sample, scratch: Sample, axis: int) -> Any:
    """Return how much more area an arm has than scratch, as a share of scratch's (Taylor and Stone, 2009)."""
    base = interquartile_mean(scratch, axis)
    return (interquartile_mean(own, axis) - base) / np.maximum(np.abs(base), 1e-9)


def estimate_cells(name: str, found: Estimate | None) -> Row:
    """Return a value and the ends of its interval as cells; empty cells for None."""
    return dict.fromkeys((name, f"{name} low", f"{name} high"), "") if found is None else found.cells(name)


def estimate(values: Sequence[float]) -> Estimate | None:
    """Return the interquartile mean, with an interval for enough seeds; None if a value is missing."""
    if not values or not np.isfinite(values).all():
        return None
    if len(values) < MIN_SEEDS:
        return Estimate(float(interquartile_mean(np.array(values))), np.nan, np.nan)
    return bootstrap([np.array(values)], interquartile_mean, SEED)


def transfer_rows(study: Study) -> list[Row]:
    """Return what each arm gained over scratch, by source and target; `ship_trl cases` recommends by it.

    Only judged seeds count, and only transfers with at least five of them. Controls, the network that was
    trained on two cases, and cases without a fingerprint in the plan are left out.
    """
    judged = study.first(len(study.seeds), study.level)
    cases = study.plan.cases
    targets: dict[str, list[tuple[Place, RunRecord]]] = defaultdict(list)
    for place in judged.places:
        part, pair, _ = place
        runs = judged.matched({"arm": place, "scratch": scratch_place(part, pair)})["arm"]
        if len(runs) < MIN_SEEDS:
            continue
        run = runs[0]
        arm = Arm.of_run(run.arm)
        if arm.is_scratch or arm.name != run.arm or arm.weights is not SourceWeights.learned:
            continue
        trained_twice = part in (LOW, ONE) and run.source == REUSED_CASE
        if not trained_twice and {run.source, run.target} <= set(cases):
            targets[run.target].append((place, run))
    rows = []
    for target, transfers in targets.items():
        # All intervals of a target together miss as often as one (Bonferroni).
        adjusted = replace(judged, level=LEVEL / 2 / len(transfers))
        for place, run in transfers:
            found = gain(adjusted, place, scratch_place(*place[:2]))
            if found is None or np.isnan(found.value):
                continue
            source, epsilon = str(run.source), LOW_EPSILON if place[0] in (LOW, ALONE) else None
            ends = (round(value, 4) for value in (found.value, found.low, found.high))
            names = source, target, cases[source], cases[target], run.profile, place[2]
            rows.append(dict(zip(COLUMNS, (*names, epsilon, found.seeds, *ends), strict=True)))
    return sorted(rows, key=lambda row: (row["target"], row["source"], row["arm"]))


def layer_rows(study: Study) -> list[Row]:
    """Return the CKA of each layer of each two networks: interquartile mean over seeds with its interval."""
    if study.layers is None:
        return []
    rows = []
    for values, own in study.layers.groupby([*LAYER_NAMES]):
        row: Row = dict(zip(LAYER_NAMES, values, strict=True))
        rows.append(row | {"seeds": len(own)} | estimate_cells("cka", estimate(own["cka"].to_list())))
    return rows


def similarity_rows(study: Study) -> list[Row]:
    """Return table 2: the similarity of source and target of each pair, the most similar first.

    With claims there are the bundled pairs too. Pairs of suites, or of cases that are not here, are left out.
    """
    world, rows, claims = load_world(), [], study.claims
    known = {pair: study.cases(pair) for pair in pairs(study)}
    if claims.judge:
        files = {pair: read_pair(pair) for pair in conf_files("pair")}
        known |= {pair: (values["source"], values["target"]) for pair, values in files.items()}
    for pair, names in sorted(known.items()):
        try:
            base, target = (load_case(str(name), world) for name in names)
        except ConfigError:
            continue
        row: Row = {"pair": pair, "source": base.name, "target": target.name}
        row |= {"similarity": similarity(base, target), "paper": claims.similarity.get(pair, "")}
        row["common"], row["different"] = describe_similarity(base, target)
        rows.append(row)
    return sorted(rows, key=lambda row: -row["similarity"])


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows atomically, with the columns of all; without rows the file is removed."""
    if not rows:
        path.unlink(missing_ok=True)
        return
    with atomic_write(path) as draft, draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, dict.fromkeys(chain.from_iterable(rows)), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


# `start` is the jumpstart of a transfer less that of scratch; `total time` counts the source's episodes.
TRANSFER = (
    *("start", "early area", "area", "greedy area", "time", "asymptote", "success", "forgetting"),
    *("total time", FORWARD),
)
TRANSFER_HEADINGS = ("run", "seeds", *TRANSFER)
BEST, LAST = "best of known", "last of known"
# `fell` and `misses` are metrics.
STABILITY_HEADINGS = (
    *("run", "runs", "fell", "misses", "area", "asymptote", f"time to {THRESHOLDS[0]}"),
    *(BEST, LAST, "last near best"),
)
# The last network is near the best one if it loses at most this share of its return.
NEAR_BEST = 0.1


def rows_of_transfer(groups: Mapping[str, Sequence[RunRecord]]) -> Iterator[list[str]]:
    """Yield a row of transfer metrics for each group of runs; its name holds pair, arm and settings.

    An arm is compared with runs from scratch of the same settings.
    """
    records, names = {}, {}
    for name, record in read_groups(groups):
        arm = record.arm
        # "low FT3 learn.lr=0.01"; the name of a folder may hold blanks too.
        pair = re.sub(rf" {re.escape(arm)}(?= \S+=|$)", "", name, count=1)
        records["", pair, arm, record.seed] = record
        names[pair, arm] = name
    for row in arm_rows(Study(records)):
        cells = []
        for name in TRANSFER:
            value, low, high = (row.get(f"{name}{end}", "") for end in ("", " low", " high"))
            cells.append("-" if value == "" else Estimate(value, low, high).words())
        yield [names[row["pair"], row["arm"]], str(row["seeds"]), *cells]


def describe_scales(runs: Iterable[RunRecord]) -> str:
    """Return a line for each target that says what scores of 0 and 1 are, and one on areas."""
    lines = {
        f"scores on {one.target}: 0 is a return of {one.random_return:g}, 1 is {one.best_known_return:g}\n"
        for one in runs
        if one.best_known_return is not None
    }
    return "".join(sorted(lines)) + "areas over training episodes; forward transfer: paired by seed\n"


def measure_runs(groups: Mapping[str, Sequence[RunRecord]]) -> Iterator[dict[str, Any]]:
    """Yield every metric of every run, and its best and last greedy return as shares of the best known.

    A run that cannot be read is named on stderr and left out.
    """
    for name, record in read_groups(groups):
        metrics = {metric: measure(record, metric) for metric in METRICS}
        returns, known = record.greedy.returns, record.best_known
        shares = {BEST: float(np.max(returns)) / known, LAST: float(returns[-1]) / known}
        yield {"run": name, "seed": record.seed, **metrics, **shares}


def stability_rows(measured: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    """Yield a table row for each group of measured runs: means over runs, with the deviation over seeds."""
    columns = ("run", "fell", "misses", "area", "asymptote", "time", BEST, LAST)
    for name, runs in pd.DataFrame(measured, columns=columns).groupby("run", sort=False):
        near = runs[LAST] >= runs[BEST] - NEAR_BEST * runs[BEST].abs()
        means, deviations = runs.mean(numeric_only=True), runs.std(numeric_only=True)
        spread = [
            f"{means[key]:.3f}" + (f" ± {deviations[key]:.3f}" if len(runs) > 1 else "")
            for key in ("area", "asymptote", "time", BEST)
        ]
        last = f"{runs[LAST].median():.3f} (median)"
        counts = [str(len(runs)), f"{runs['fell'].sum():.0f}", f"{means['misses']:.3f}"]
        yield [str(name), *counts, *spread, last, f"{near.sum()} of {len(runs)}"]
