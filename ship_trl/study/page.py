"""The report as one page of HTML that needs nothing else: template and what goes into it."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2

from ship_trl.study.answers import Answer
from ship_trl.study.contrasts import LEAST_SEEDS, MARGIN
from ship_trl.study.measured import Study
from ship_trl.study.statistics import Estimate
from ship_trl.study.tables import Row

ARM_METRICS = (
    "area",
    "transfer ratio",
    "greedy area",
    "asymptote",
    "jumpstart",
    "time to threshold",
    "success",
    "collisions",
    "best",
    "DCPA",
)
POWER = (
    "With {seeds} seeds only large differences can be seen: inconclusive says that none was seen, "
    "not that there is none."
)


def number(value: Any, digits: int = 2) -> str:
    """A number for people; nothing where there is none."""
    return f"{value:.{digits}f}" if isinstance(value, int | float) else str(value)


def interval(found: Estimate | None) -> str:
    """The ends of an interval."""
    return "" if found is None else f"{found.low:+.3f} to {found.high:+.3f}"


def contrast_rows(answers: Sequence[Answer]) -> list[dict[str, Any]]:
    """A row for each contrast."""
    return [
        {
            "claim": answer.hypothesis.name,
            "what": finding.what,
            "estimate": f"{finding.estimate.value:+.3f}",
            "interval": interval(finding.estimate),
            "improvement": "" if finding.improvement is None else f"{finding.improvement.value:.2f}",
            "p": f"{finding.adjusted:.3f}",
            "seeds": finding.seeds,
            "verdict": finding.verdict.value,
        }
        for answer in answers
        for finding in answer.findings
    ]


def arm_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Part, pair and arm, seeds, then each metric with its interval."""
    cells = []
    for row in rows:
        line = [row["part"], row["pair"], row["arm"], str(row["seeds"])]
        for name in ARM_METRICS:
            digits = 0 if name in ("time to threshold", "DCPA") else 2
            low, high = number(row[f"{name} low"], digits), number(row[f"{name} high"], digits)
            line.append(f"{number(row[name], digits)} ({low} to {high})" if row[name] != "" else "")
        cells.append(line)
    return cells


def counts(answer: Answer) -> str:
    """How many contrasts came out how."""
    found = Counter(finding.verdict.value for finding in answer.findings)
    return ", ".join(f"{count} {verdict}" for verdict, count in found.items()) or "no runs"


def render(
    study: Study,
    answers: Sequence[Answer],
    arms: Sequence[Row],
    figures: Sequence[tuple[str, str, Path]],
    missing: int,
) -> str:
    """The page.

    Args:
        study: what was read.
        answers: the claims measured.
        arms: rows of `tables.arm_rows`.
        figures: title, caption and PNG of each.
        missing: how many planned runs there are not.
    """
    records = list(study.records.values())
    seeds = len({key[3] for key in study.records})
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template("page.html").render(
        title="Work process transfer in ship collision avoidance: a study",
        runs=len(records),
        profile=", ".join(sorted({r.profile for r in records})),
        episodes=", ".join(sorted({str(len(r.training.total)) for r in records})),
        seeds=seeds,
        missing=missing,
        margin=MARGIN,
        least=LEAST_SEEDS,
        power=POWER.format(seeds=seeds),
        answers=[
            {
                "name": a.hypothesis.name,
                "figure": a.hypothesis.figure,
                "sentence": a.hypothesis.sentence,
                "verdict": a.verdict.value,
                "counts": counts(a),
            }
            for a in answers
        ],
        contrasts=contrast_rows(answers),
        arm_columns=("part", "pair", "arm", "seeds", *ARM_METRICS),
        arms=arm_cells(arms),
        figures=[
            {"title": title, "caption": caption, "data": base64.b64encode(path.read_bytes()).decode()}
            for title, caption, path in figures
        ],
        broken=[(str(path), reason) for path, reason in study.broken],
    )
