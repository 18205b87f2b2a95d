"""The report as one page of HTML that needs nothing else: template and what goes into it."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, isfinite
from pathlib import Path
from typing import Any

import jinja2

from ship_trl.study.answers import Answer
from ship_trl.study.conclusions import FIGURE as CONCLUSIONS
from ship_trl.study.contrasts import LEAST_SEEDS, LEVEL, MARGIN, Finding, Verdict
from ship_trl.study.measured import Study
from ship_trl.study.placebo import Placebo
from ship_trl.study.similarities import EQUATION
from ship_trl.study.statistics import Estimate
from ship_trl.study.tables import Row

ARM_METRICS = (
    "area",
    "area deviation",
    "transfer ratio",
    "greedy area",
    "asymptote",
    "jumpstart",
    "time to threshold",
    "reached",
    "success",
    "collisions",
    "best",
    "DCPA",
)


@dataclass(frozen=True)
class Drawn:
    """A figure: its title, what it shows, and its PNG."""

    title: str
    caption: str
    png: Path


def number(value: Any, digits: int = 2) -> str:
    """A number for people; nothing where there is none."""
    return f"{value:.{digits}f}" if isinstance(value, int | float) else str(value)


def interval(found: Estimate | None) -> str:
    """The ends of an interval."""
    return "" if found is None else f"{found.low:+.3f} to {found.high:+.3f}"


def contrast_row(claim: str, finding: Finding) -> dict[str, Any]:
    """A contrast as words."""
    improvement = finding.improvement
    return {
        "claim": claim,
        "what": finding.what,
        "estimate": f"{finding.estimate.value:+.3f}",
        "interval": interval(finding.estimate),
        "improvement": "" if improvement is None else f"{improvement.value:.2f}",
        "claimed": finding.claimed.value,
        "p": f"{finding.adjusted:.3f}",
        "beyond": f"{finding.beyond:.3f}",
        "seeds": finding.seeds,
        "seen": seen(finding),
        "verdict": finding.verdict.value,
    }


def seen(finding: Finding) -> str:
    """What so many seeds could have shown: alone, and adjusted for the figure's other contrasts."""
    values = [finding.seen(LEVEL), finding.seen(LEVEL / finding.family)]
    return " / ".join(f"{value:.2f}" for value in values) if isfinite(values[0]) else ""


def arm_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Part, pair and arm, seeds, then each metric, with its interval where it has one."""
    cells = []
    for row in rows:
        line = [row["part"], row["pair"], row["arm"], str(row["seeds"])]
        for name in ARM_METRICS:
            digits = 0 if name in ("time to threshold", "reached", "DCPA") else 2
            ends = [row.get(f"{name} {end}", "") for end in ("low", "high")]
            whole = all(isinstance(end, float) and isfinite(end) for end in ends)
            between = f" ({number(ends[0], digits)} to {number(ends[1], digits)})" if whole else ""
            line.append(number(row[name], digits) + between)
        cells.append(line)
    return cells


def in_a_sentence(answer: Answer) -> str:
    """What was measured of a claim: its number, or how its contrasts came out and between which."""
    findings = answer.findings
    if not findings:
        return "No runs."
    if len(findings) == 1:
        (one,) = findings
        value, ends = f"{one.estimate.value:+.3f}", interval(one.estimate)
        words = f"{one.what}: {value} ({ends}), adjusted p {one.adjusted:.3f}."
    else:
        found = Counter(finding.verdict.value for finding in findings)
        counts = ", ".join(f"{count} {verdict}" for verdict, count in found.most_common())
        values = [finding.estimate.value for finding in findings]
        leaning = sum(finding.as_claimed for finding in findings)
        words = f"{len(findings)} contrasts: {counts}; {leaning} estimated as claimed"
        words += f" ({min(values):+.3f} to {max(values):+.3f})."
    open_ = [f for f in findings if f.verdict is Verdict.inconclusive and isfinite(f.deviation)]
    if open_:
        alone, after = ([f.seen(LEVEL / m) for f in open_] for m in (1, open_[0].family))
        words += f" Could see differences from {spread(alone)} on, adjusted {spread(after)}."
    return words + (f" Without runs: {answer.missing} of its contrasts." if answer.missing else "")


def spread(values: Sequence[float]) -> str:
    """The least and the largest."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def claim(answer: Answer) -> dict[str, str]:
    """A claim as words."""
    return {
        "name": answer.hypothesis.name,
        "figure": answer.hypothesis.figure,
        "sentence": answer.hypothesis.sentence,
        "verdict": answer.verdict.value,
        "measured": in_a_sentence(answer),
    }


def as_markdown(answers: Sequence[Answer]) -> str:
    """All verdicts as a table of Markdown, for a README."""
    lines = ["| claim | verdict | the paper | measured |", "| --- | --- | --- | --- |"]
    for row in map(claim, answers):
        # A bar would end the cell, and "<" may begin a tag.
        words = [row[key].replace("|", "/").replace("<", "&lt;") for key in ("sentence", "measured")]
        lines.append(f"| {row['name']} | {row['verdict']} | {' | '.join(words)} |")
    return "\n".join(lines) + "\n"


def render(
    study: Study,
    answers: Sequence[Answer],
    arms: Sequence[Row],
    similar: Sequence[Row],
    figures: Sequence[Drawn],
    shuffled: Placebo | None,
    missing: int,
) -> str:
    """The page.

    Args:
        study: what was read.
        answers: the claims measured.
        arms: rows of `tables.arm_rows`.
        similar: rows of `similarities.table_2`.
        figures: what was drawn.
        shuffled: what the rules found where there is nothing; None with too few seeds for verdicts.
        missing: how many planned runs there are not.
    """
    records = list(study.records.values())
    seeds = len({key[3] for key in study.records})
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        runs=len(records),
        profile=", ".join(sorted({r.profile for r in records})),
        episodes=", ".join(sorted({str(len(r.training.total)) for r in records})),
        seeds=seeds,
        # Of exact tests of as many runs on two sides: all of one beyond all of the other.
        least_p=number(2 / comb(2 * seeds, seeds), 4),
        missing=missing,
        mixed={
            key: ", ".join(f"{value} ({count})" for value, count in counts.items())
            for key, counts in study.mixed().items()
        },
        margin=MARGIN,
        least=LEAST_SEEDS,
        shuffled=shuffled,
        conclusions=[claim(a) for a in answers if a.hypothesis.figure == CONCLUSIONS],
        claims=[claim(a) for a in answers if a.hypothesis.figure != CONCLUSIONS],
        contrasts=[contrast_row(a.hypothesis.name, finding) for a in answers for finding in a.findings],
        arm_columns=("part", "pair", "arm", "seeds", *ARM_METRICS),
        arms=arm_cells(arms),
        similar=[
            {**row, "similarity": number(row["similarity"]), "paper": number(row["paper"])} for row in similar
        ],
        equation=EQUATION,
        figures=[
            {"title": f.title, "caption": f.caption, "data": base64.b64encode(f.png.read_bytes()).decode()}
            for f in figures
        ],
        broken=[(str(path), reason) for path, reason in study.broken],
    )
