"""The study's numbers as tables: a row for each run, arm, claim and contrast; CSV beside the report."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.config.errors import one_line
from ship_trl.files.disk import replacing
from ship_trl.files.table import Cells, read_table
from ship_trl.study.analysis.contrasts import LEAST_SEEDS, Finding, Verdict
from ship_trl.study.analysis.measured import SEED, gain
from ship_trl.study.analysis.metrics import METRICS, measure, reached
from ship_trl.study.analysis.statistics import LEVEL, Estimate, bootstrap, interquartile_mean, share_interval
from ship_trl.study.analysis.study import Place, Study
from ship_trl.study.claims.verdicts import Answer
from ship_trl.study.plan.config import REUSED_CASE
from ship_trl.study.plan.jobs import ALONE, LOW, LOW_EPSILON, ONE, from_scratch
from ship_trl.study.records.record import Record
from ship_trl.transfer.measured import COLUMNS

Row = dict[str, Any]
# Bytes of a table that is read, at most: one of a hundred contrasts has 50,000.
LARGEST = 10_000_000
# Columns of claims.csv that are of a contrast.
CONTRAST = (
    *("contrast", "metric", "estimate", "estimate low", "estimate high", "claimed"),
    *("p", "p against", "p against adjusted", "margin", "p beyond margin", "seeds"),
    *("seen alone", "seen adjusted", "verdict", "beside"),
)


def run_rows(study: Study) -> list[Row]:
    """Every number of every run."""
    rows = []
    for (part, pair, arm, seed), record in sorted(study.records.items()):
        row: Row = {"part": part, "pair": pair, "arm": arm, "seed": seed}
        row |= {name: measure(record, name) for name in METRICS}
        row["reached"] = reached(record)
        rows.append(row)
    return rows


def arm_rows(study: Study) -> list[Row]:
    """Each metric of each arm: interquartile mean over seeds with its interval, and the transfer ratio."""
    rows = []
    places = sorted({key[:3] for key in study.records})
    for part, pair, arm in places:
        runs = list(study.arm(part, pair, arm).values())
        row: Row = {"part": part, "pair": pair, "arm": arm, "seeds": len(runs)}
        for name in METRICS:
            row |= columns(name, estimate([measure(run, name) for run in runs]))
        areas = [measure(run, "area") for run in runs]
        row["area deviation"] = float(np.std(areas, ddof=1)) if len(runs) > 1 else ""
        row["reached"] = sum(map(reached, runs))
        # A share of runs is no level: all of them count.
        row |= columns("fell", share_interval(sum(int(measure(run, "fell")) for run in runs), len(runs)))
        row |= columns("transfer ratio", transfer_ratio(study, part, pair, arm))
        rows.append(row)
    return rows


def columns(name: str, found: Estimate | None) -> Row:
    """Write a value and the ends of its interval; empty where there is none."""
    values = ("", "", "") if found is None else (found.value, found.low, found.high)
    return dict(zip((name, f"{name} low", f"{name} high"), values, strict=True))


def estimate(values: Sequence[float]) -> Estimate | None:
    """Compute the interquartile mean and, of enough seeds, its interval; None where a number is missing."""
    if not values or not np.isfinite(values).all():
        return None
    if len(values) < LEAST_SEEDS:
        return Estimate(float(interquartile_mean(np.array(values))), np.nan, np.nan)
    return bootstrap([np.array(values)], interquartile_mean, SEED)


def transfer_ratio(study: Study, part: str, pair: str, arm: str) -> Estimate | None:
    """How much more area an arm has than scratch, as a share of scratch's (Taylor and Stone, 2009)."""
    runs = study.matched({"arm": (part, pair, arm), "scratch": from_scratch(part, pair)})
    if arm == "scratch" or len(runs["arm"]) < LEAST_SEEDS:
        return None
    areas = [np.array([measure(run, "area") for run in runs[name]]) for name in ("arm", "scratch")]

    def ratio(one: Any, scratch: Any, axis: int) -> Any:
        base = interquartile_mean(scratch, axis)
        return (interquartile_mean(one, axis) - base) / np.maximum(np.abs(base), 1e-9)

    return bootstrap(areas, ratio, SEED)


def transfer_rows(study: Study, fingerprints: Mapping[str, str]) -> list[Row]:
    """Return what each arm gained over scratch by source and target; `ship_trl.cases` recommends by it.

    Only seeds that are judged count, and transfers that have five of them. Left out are controls without
    features, and a network that two transfers made. `fingerprints` say what a case is, by name; of a case
    without one nothing is said.
    """
    judged = study.first(len(study.seeds), study.level)
    targets: dict[str, list[tuple[Place, list[Record]]]] = defaultdict(list)
    for part, pair, arm in sorted({key[:3] for key in judged.records}):
        place = part, pair, arm
        runs = judged.matched({"arm": place, "scratch": from_scratch(part, pair)})["arm"]
        if arm == "scratch" or "-" in arm or len(runs) < LEAST_SEEDS:
            continue
        source, target = runs[0].source, runs[0].target
        chained = part in (LOW, ONE) and source == REUSED_CASE
        if not chained and {source, target} <= set(fingerprints):
            targets[target].append((place, runs))
    rows = []
    for target, transfers in targets.items():
        # All intervals of a target together miss as often as one.
        seen = replace(judged, level=LEVEL / 2 / len(transfers))
        for (part, pair, arm), runs in transfers:
            found = gain(seen, (part, pair, arm), from_scratch(part, pair))
            if found is None:
                continue
            row = {
                "source": runs[0].source,
                "target": target,
                "source_fingerprint": fingerprints[str(runs[0].source)],
                "target_fingerprint": fingerprints[target],
                "profile": runs[0].profile,
                "arm": arm,
                "epsilon_start": LOW_EPSILON if part in (LOW, ALONE) else None,
                "seeds": len(runs),
                "gain": round(found.value, 4),
                "low": round(found.low, 4),
                "high": round(found.high, 4),
            }
            rows.append({name: row[name] for name in COLUMNS})
    return sorted(rows, key=lambda row: (row["target"], row["source"], row["arm"]))


def claim_rows(answers: Sequence[Answer]) -> list[Row]:
    """Return every contrast of every claim, with the claim's verdict; one row for a claim without runs."""
    return [
        {
            "claim": answer.hypothesis.name,
            "figure": answer.hypothesis.figure,
            "sentence": answer.hypothesis.sentence,
            "claim's verdict": answer.word,
            "claim's p": answer.p if answer.findings else "",
            "decided after seeds": answer.decided or "",
            "seeds wanted": answer.wanted() or "",
            **contrast_columns(answer, finding),
        }
        for answer in answers
        for finding in tuple(answer.findings) or (None,)
    ]


def contrast_columns(answer: Answer, finding: Finding | None) -> Row:
    """Write what was measured of a contrast; empty where there is none."""
    if finding is None:
        return dict.fromkeys(CONTRAST, "")
    values = (
        finding.what,
        finding.metric,
        *columns("estimate", finding.estimate).values(),
        finding.claimed.value,
        finding.p,
        finding.against,
        finding.adjusted,
        "" if finding.margin is None else finding.margin,
        finding.within,
        finding.seeds,
        finding.seen(answer.level),
        finding.seen(answer.level / answer.claims),
        finding.verdict.value,
        "; ".join(f"{name} {found.value:+.3f}" for name, found in finding.beside.items()),
    )
    return dict(zip(CONTRAST, values, strict=True))


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows beside and rename; without rows there is no file."""
    if not rows:
        path.unlink(missing_ok=True)
        return
    with replacing(path) as draft, draft.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read_verdicts(path: Path) -> dict[str, tuple[str, str]]:
    """Read from a report's claims.csv, by claim, its verdict and the sentence that was judged.

    Raises:
        ConfigError: it is none; `--earlier` is what it was given as.
    """
    names = "claim", "claim's verdict", "sentence"
    return dict(read_table(path, names, verdict_of, LARGEST, "--earlier", "a report's claims.csv"))


def verdict_of(row: Cells) -> tuple[str, tuple[str, str]]:
    """Make of a row's cells a claim's name, its verdict and its sentence.

    Raises:
        ValueError: there is no such verdict.
    """
    allowed = *(verdict.value for verdict in Verdict), "no runs"
    verdict = row["claim's verdict"]
    if verdict not in allowed:
        raise ValueError(f"it has the verdict {verdict!r:.50}; allowed: {', '.join(allowed)}")
    return row["claim"], (verdict, one_line(row["sentence"]))
