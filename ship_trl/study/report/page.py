"""The report as one page of HTML that needs no other file, and its verdicts as Markdown."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import jinja2

from ship_trl.study.analysis.contrasts import MIN_SEEDS, SPREAD, Finding, Verdict
from ship_trl.study.analysis.metrics import THRESHOLDS
from ship_trl.study.analysis.power import min_detectable_effect
from ship_trl.study.analysis.statistics import Estimate, look_level
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.conclusions import EXPLORATORY
from ship_trl.study.claims.conclusions import FIGURE as CONCLUSIONS
from ship_trl.study.claims.verdicts import Answer
from ship_trl.study.report.figures import Picture
from ship_trl.study.report.tables import EQUATION, Row
from ship_trl.study.rules import describe_rules

# Verdict and sentence of each claim in an earlier study.
Earlier = Mapping[str, tuple[str, str]]
# Families of claims that are no figure of the paper.
FAMILIES = {CONCLUSIONS: "Conclusions", EXPLORATORY: "What explains them"}
ARM_METRICS = (
    *("area", "area deviation", "transfer ratio", "greedy area", "asymptote", "start", "time", "total time"),
    *("reached", "fell", "success", "collisions", "best", "DCPA"),
)
# The bars of contrasts reach at most this multiple of the largest estimate.
MAX_REACH = 2.5


@dataclass(frozen=True)
class Scale:
    """The values between which bars are drawn."""

    low: float
    high: float

    def percent(self, value: float) -> float:
        """Return where a value lies, from 0 to 100."""
        inside = min(max(value, self.low), self.high)
        return round(100 * (inside - self.low) / (self.high - self.low), 2)


def number(value: Any, digits: int = 2) -> str:
    """Format a number; other values as they are."""
    return f"{value:.{digits}f}" if isinstance(value, int | float) else str(value)


def interval(found: Estimate) -> str:
    """Format the ends of an interval."""
    bounded = isfinite(found.low) and isfinite(found.high)
    return f"{found.low:+.3f} to {found.high:+.3f}" if bounded else "unbounded"


def unit(finding: Finding) -> str:
    """Return what a contrast is measured in: only contrasts of one unit share a scale."""
    return finding.metric if finding.metric in (SPREAD, "start") else "difference"


def scale_of(findings: Sequence[Finding]) -> Scale:
    """Return the scale of contrasts: it holds zero, all estimates, and intervals up to `MAX_REACH`."""
    most = MAX_REACH * max(
        [abs(f.estimate.value) for f in findings] + [f.margin or 0.0 for f in findings] + [0.01]
    )
    ends = [min(max(end, -most), most) for f in findings for end in (f.estimate.low, f.estimate.high)]
    low, high = min([*ends, 0.0]), max([*ends, 0.0])
    room = 0.03 * (high - low) or most
    return Scale(low - room, high + room)


def contrast_row(answer: Answer, finding: Finding, scale: Scale) -> dict[str, Any]:
    """Return a contrast as words, and where its bar lies."""
    seen = [finding.min_detectable(answer.level / claims) for claims in (1, answer.claims)]
    margin = finding.margin
    return {
        "what": finding.what,
        "claimed": finding.claimed.value,
        "estimate": f"{finding.estimate.value:+.3f}",
        "interval": interval(finding.estimate),
        "p": f"{finding.p:.4f}",
        "against": f"{finding.adjusted:.3f}",
        "margin": "" if margin is None else f"{margin:.3f}",
        "within": "" if margin is None else f"{finding.within:.3f}",
        "seeds": finding.seeds,
        "seen": " / ".join(f"{value:.2f}" for value in seen) if isfinite(seen[0]) else "",
        "beside": "; ".join(f"{name} {found.value:+.3f}" for name, found in finding.beside.items()),
        "verdict": finding.verdict.value,
        "zero": scale.percent(0.0),
        "value": scale.percent(finding.estimate.value),
        "ends": [scale.percent(end) for end in (finding.estimate.low, finding.estimate.high)],
        "band": [scale.percent(sign * margin) for sign in (-1, 1)] if margin else [],
    }


def families(answers: Sequence[Answer]) -> Iterator[dict[str, Any]]:
    """Yield each family of claims with all its contrasts; those of a unit share a scale."""
    for figure in dict.fromkeys(answer.hypothesis.figure for answer in answers):
        family = [answer for answer in answers if answer.hypothesis.figure == figure]
        found = [finding for answer in family for finding in answer.findings]
        if not found:
            continue
        scales = {name: scale_of([f for f in found if unit(f) == name]) for name in map(unit, found)}
        yield {
            "title": FAMILIES.get(figure, f"Figure {figure}"),
            "count": len(found),
            "claims": [
                {
                    "name": answer.hypothesis.name,
                    "verdict": answer.word,
                    "sentence": answer.hypothesis.sentence,
                    "contrasts": [contrast_row(answer, f, scales[unit(f)]) for f in answer.findings],
                }
                for answer in family
            ],
        }


def arm_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Return part, pair, arm and seeds of each arm, then each metric with its interval."""
    cells = []
    for row in rows:
        line = [row["part"], row["pair"], row["arm"], str(row["seeds"])]
        for name in ARM_METRICS:
            digits = 0 if name in ("reached", "DCPA") else 2
            ends = [row.get(f"{name} {end}", "") for end in ("low", "high")]
            has_ends = all(isinstance(end, float) and isfinite(end) for end in ends)
            between = f" ({number(ends[0], digits)} to {number(ends[1], digits)})" if has_ends else ""
            line.append(number(row[name], digits) + between)
        cells.append(line)
    return cells


def in_a_sentence(answer: Answer) -> str:
    """Say what was measured of a claim: its contrast, or how its contrasts came out."""
    findings = answer.findings
    if not findings:
        return "No runs."
    if len(findings) == 1:
        (one,) = findings
        words = f"{one.what}: {one.estimate.value:+.3f} ({interval(one.estimate)}), p {one.p:.3f}"
    else:
        found = Counter(finding.verdict.value for finding in findings)
        counts = ", ".join(f"{count} {verdict}" for verdict, count in found.most_common())
        values = [finding.estimate.value for finding in findings]
        agreeing = sum(finding.as_claimed for finding in findings)
        words = f"{len(findings)} contrasts: {counts}; {agreeing} estimated as claimed"
        words += f" ({min(values):+.3f} to {max(values):+.3f}); largest p {max(f.p for f in findings):.3f}"
    words += f"; adjusted {answer.p:.3f} for the verdict."
    if answer.decided:
        words += f" Decided after {answer.decided} seeds."
    # Where each contrast holds alone and the claim is open, all contrasts are short of the adjusted level.
    unsure = [f for f in findings if f.verdict is Verdict.inconclusive]
    if not answer.decided and all(f.verdict is Verdict.supported for f in findings):
        unsure = findings
    if known := [f for f in unsure if isfinite(f.error)]:
        alone, adjusted = ([f.min_detectable(answer.level / m) for f in known] for m in (1, answer.claims))
        words += f" Could see differences from {spread(alone)} on, adjusted {spread(adjusted)}."
    if wanted := answer.seeds_wanted():
        words += f" {wanted} seeds would tell differences of the margin from none, four times in five."
    if answer.missing:
        count = len(answer.hypothesis.tests)
        words += f" Still without {answer.seeds} seeds: {answer.missing} of {count} contrasts."
    return words


def spread(values: Sequence[float]) -> str:
    """Format the least and the largest value."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def claim_row(answer: Answer, earlier: Earlier) -> dict[str, str]:
    """Return a claim as words, with the verdict of an earlier study and its sentence if it was another."""
    hypothesis, said = answer.hypothesis, ""
    if hypothesis.name in earlier:
        verdict, sentence = earlier[hypothesis.name]
        of = "" if sentence == hypothesis.sentence else f', of "{sentence}"'
        said = f" An earlier study, by its own rules{of}: {verdict}."
    return {
        "name": hypothesis.name,
        "figure": hypothesis.figure,
        "sentence": hypothesis.sentence,
        "verdict": answer.word,
        "measured": in_a_sentence(answer) + said,
    }


def describe_intervals(answers: Sequence[Answer], looks: int) -> str:
    """Say at what level the intervals of claims are."""
    levels = sorted({(answer.seeds, answer.level) for answer in answers if answer.findings})
    shares = ", ".join(f"{100 - 200 * level:.4g} % after {seeds} seeds" for seeds, level in levels)
    words = f"Each interval is at the level of the look that its claim was judged at: {shares or 'none yet'}."
    if looks > 1:
        words += (
            f" The levels are O'Brien and Fleming's: all {looks} looks together err as often as one at 95 %."
        )
    return words


def as_markdown(answers: Sequence[Answer], earlier: Earlier, looks: int) -> str:
    """Return all verdicts as Markdown: the level of the intervals, then a table."""
    lines = [describe_intervals(answers, looks), ""]
    lines += ["| claim | verdict | the paper | measured |", "| --- | --- | --- | --- |"]
    for row in (claim_row(answer, earlier) for answer in answers):
        # "|" would end the cell, and "<" could begin a tag.
        words = [row[key].replace("|", "/").replace("<", "&lt;") for key in ("sentence", "measured")]
        lines.append(f"| {row['name']} | {row['verdict']} | {' | '.join(words)} |")
    return "\n".join(lines) + "\n"


def embed(picture: Picture) -> dict[str, str]:
    """Return a picture as text; the browser shows its wide or its narrow form."""
    wide, narrow = (base64.b64encode(data).decode() for data in (picture.wide, picture.narrow))
    return {"title": picture.title, "caption": picture.caption, "wide": wide, "narrow": narrow}


def render(
    study: Study,
    answers: Sequence[Answer],
    explored: Sequence[Answer],
    arms: Sequence[Row],
    similar: Sequence[Row],
    pictures: Sequence[Picture],
    missing: int,
    earlier: Earlier,
) -> str:
    """Return the page.

    Args:
        study: the runs.
        answers: the paper's claims.
        explored: our own contrasts.
        arms: rows of `tables.arm_rows`.
        similar: rows of `tables.similarity_rows`.
        pictures: the figures.
        missing: the number of planned runs that are not there.
        earlier: verdicts of an earlier study.
    """
    records = list(study.records.values())
    computed = {
        key: f"{key}: {', '.join(f'{value} ({count})' for value, count in counts.items())}"
        for key, counts in study.computed().items()
    }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    levels = [(count, look_level(k, len(study.looks))) for k, count in enumerate(study.looks, 1)]
    claims = [claim_row(answer, earlier) for answer in answers]
    return environment.get_template("page.html").render(
        runs=len(records),
        profile=", ".join(sorted({r.profile for r in records})),
        episodes=", ".join(sorted({str(len(r.training.returns)) for r in records})),
        seeds=len({key[3] for key in study.records}),
        missing=missing,
        threshold=f"{THRESHOLDS[0]:g}",
        rules=describe_rules(study.plan.rules),
        mixed=[computed[key] for key, counts in study.computed().items() if len(counts) > 1],
        computed=list(computed.values()),
        looks=[
            {
                "seeds": count,
                "level": number(level, 5),
                "seen": number(min_detectable_effect(count, level), 1) if count >= MIN_SEEDS else "",
            }
            for count, level in levels
        ],
        least=MIN_SEEDS,
        intervals=describe_intervals(answers, len(levels)),
        decided=[row for row, answer in zip(claims, answers, strict=True) if answer.decided],
        conclusions=[row for row in claims if row["figure"] == CONCLUSIONS],
        claims=[row for row in claims if row["figure"] != CONCLUSIONS],
        explored=[claim_row(answer, {}) for answer in explored],
        families=list(families([*answers, *explored])),
        arm_columns=("part", "pair", "arm", "seeds", *ARM_METRICS),
        arms=arm_cells(arms),
        similar=[row | {key: number(row[key]) for key in ("similarity", "paper")} for row in similar],
        equation=EQUATION,
        figures=[embed(picture) for picture in pictures],
        broken=[(str(path), reason) for path, reason in study.broken],
    )
