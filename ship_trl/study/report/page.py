"""The report as one page of HTML that needs nothing else: template and what goes into it."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import jinja2

from ship_trl.study.analysis.contrasts import LEAST_SEEDS, Finding, Verdict
from ship_trl.study.analysis.metrics import THRESHOLDS
from ship_trl.study.analysis.power import seen_effect
from ship_trl.study.analysis.statistics import Estimate, look_level
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.conclusions import FIGURE as CONCLUSIONS
from ship_trl.study.claims.kinds import Hypothesis
from ship_trl.study.claims.placebo import Placebo
from ship_trl.study.claims.verdicts import Answer
from ship_trl.study.report.drawings import Drawn
from ship_trl.study.report.similarities import EQUATION
from ship_trl.study.report.tables import Row
from ship_trl.study.rules import told

# Verdict and sentence of a claim in an earlier study, by its name.
Earlier = Mapping[str, tuple[str, str]]

ARM_METRICS = (
    "area",
    "area deviation",
    "transfer ratio",
    "greedy area",
    "asymptote",
    "start",
    "time",
    "total time",
    "reached",
    "fell",
    "success",
    "collisions",
    "best",
    "DCPA",
)


def number(value: Any, digits: int = 2) -> str:
    """Write a number for people; nothing where there is none."""
    return f"{value:.{digits}f}" if isinstance(value, int | float) else str(value)


def interval(found: Estimate | None) -> str:
    """Write the ends of an interval."""
    return "" if found is None else f"{found.low:+.3f} to {found.high:+.3f}"


def contrast_row(answer: Answer, finding: Finding) -> dict[str, Any]:
    """Return a contrast as words."""
    values = [finding.seen(answer.level), finding.seen(answer.level / answer.claims)]
    return {
        "claim": answer.hypothesis.name,
        "what": finding.what,
        "estimate": f"{finding.estimate.value:+.3f}",
        "interval": interval(finding.estimate),
        "claimed": finding.claimed.value,
        "p": f"{finding.p:.4f}",
        "against": f"{finding.adjusted:.3f}",
        "margin": "" if finding.margin is None else f"{finding.margin:.3f}",
        "within": "" if finding.margin is None else f"{finding.within:.3f}",
        "seeds": finding.seeds,
        "seen": " / ".join(f"{value:.2f}" for value in values) if isfinite(values[0]) else "",
        "beside": "; ".join(f"{name} {found.value:+.3f}" for name, found in finding.beside.items()),
        "verdict": finding.verdict.value,
    }


def arm_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Part, pair and arm, seeds, then each metric, with its interval where it has one."""
    cells = []
    for row in rows:
        line = [row["part"], row["pair"], row["arm"], str(row["seeds"])]
        for name in ARM_METRICS:
            digits = 0 if name in ("reached", "DCPA") else 2
            ends = [row.get(f"{name} {end}", "") for end in ("low", "high")]
            whole = all(isinstance(end, float) and isfinite(end) for end in ends)
            between = f" ({number(ends[0], digits)} to {number(ends[1], digits)})" if whole else ""
            line.append(number(row[name], digits) + between)
        cells.append(line)
    return cells


def in_a_sentence(answer: Answer) -> str:
    """Say what was measured of a claim: its number, or how its contrasts came out and between which."""
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
        leaning = sum(finding.as_claimed for finding in findings)
        words = f"{len(findings)} contrasts: {counts}; {leaning} estimated as claimed"
        words += f" ({min(values):+.3f} to {max(values):+.3f}); largest p {max(f.p for f in findings):.3f}"
    words += f"; adjusted {answer.p:.3f} for the verdict."
    if answer.decided:
        words += f" Decided after {answer.decided} seeds."
    # Of an open claim whose contrasts each hold alone, all are short of what the figure asks for.
    unsure = [f for f in findings if f.verdict is Verdict.inconclusive]
    if not answer.decided and all(f.verdict is Verdict.supported for f in findings):
        unsure = findings
    open_ = [f for f in unsure if isfinite(f.error)]
    if open_:
        alone, after = ([f.seen(answer.level / m) for f in open_] for m in (1, answer.claims))
        words += f" Could see differences from {spread(alone)} on, adjusted {spread(after)}."
    if wanted := answer.wanted():
        words += f" {wanted} seeds would tell differences of the margin from none, four times in five."
    if answer.missing:
        count = len(answer.hypothesis.tests)
        words += f" Still without {answer.seeds} seeds: {answer.missing} of {count} contrasts."
    return words


def spread(values: Sequence[float]) -> str:
    """Write the least and the largest."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def said_earlier(hypothesis: Hypothesis, earlier: Earlier) -> str:
    """Write what an earlier study said of a claim, and of what, for its sentence may have been another."""
    if hypothesis.name not in earlier:
        return ""
    verdict, sentence = earlier[hypothesis.name]
    of = "" if sentence == hypothesis.sentence else f', of "{sentence}"'
    return f" An earlier study, by its own rules{of}: {verdict}."


def claim(answer: Answer, earlier: Earlier) -> dict[str, str]:
    """Write a claim as words, with what an `earlier` study said of it."""
    return {
        "name": answer.hypothesis.name,
        "figure": answer.hypothesis.figure,
        "sentence": answer.hypothesis.sentence,
        "verdict": answer.word,
        "measured": in_a_sentence(answer) + said_earlier(answer.hypothesis, earlier),
    }


def as_markdown(answers: Sequence[Answer], earlier: Earlier) -> str:
    """All verdicts as a table of Markdown, for a README."""
    lines = ["| claim | verdict | the paper | measured |", "| --- | --- | --- | --- |"]
    for row in (claim(answer, earlier) for answer in answers):
        # A bar would end the cell, and "<" may begin a tag.
        words = [row[key].replace("|", "/").replace("<", "&lt;") for key in ("sentence", "measured")]
        lines.append(f"| {row['name']} | {row['verdict']} | {' | '.join(words)} |")
    return "\n".join(lines) + "\n"


def shown(figure: Drawn) -> dict[str, str]:
    """Write a figure as text: both its forms are in the page, of which the browser shows one."""
    wide, narrow = (base64.b64encode(data).decode() for data in (figure.wide, figure.narrow))
    return {"title": figure.title, "caption": figure.caption, "wide": wide, "narrow": narrow}


def render(
    study: Study,
    answers: Sequence[Answer],
    explored: Sequence[Answer],
    arms: Sequence[Row],
    similar: Sequence[Row],
    figures: Sequence[Drawn],
    shuffled: Placebo | None,
    missing: int,
    earlier: Earlier,
) -> str:
    """Make the page.

    Args:
        study: what was read.
        answers: the claims measured.
        explored: our own contrasts, which judge no claim.
        arms: rows of `tables.arm_rows`.
        similar: rows of `similarities.table_2`.
        figures: what was drawn.
        shuffled: what the rules found where there is nothing; None with too few seeds for verdicts.
        missing: how many planned runs there are not.
        earlier: verdicts of an earlier study with the sentences that it judged, by claim.
    """
    records = list(study.records.values())
    seeds = len({key[3] for key in study.records})
    computed = [
        (len(counts) == 1, f"{key}: {', '.join(f'{value} ({count})' for value, count in counts.items())}")
        for key, counts in study.computed().items()
    ]
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
        episodes=", ".join(sorted({str(len(r.training.returns)) for r in records})),
        seeds=seeds,
        missing=missing,
        threshold=f"{THRESHOLDS[0]:g}",
        rules=told(study.rules),
        mixed=[counts for alike, counts in computed if not alike],
        computed=[counts for _, counts in computed],
        looks=[
            {
                "seeds": count,
                "level": number(level, 5),
                "seen": number(seen_effect(count, level), 1) if count >= LEAST_SEEDS else "",
            }
            for k, count in enumerate(study.looks, 1)
            for level in (look_level(k, len(study.looks)),)
        ],
        least=LEAST_SEEDS,
        shuffled=shuffled,
        decided=[claim(a, earlier) for a in answers if a.decided],
        conclusions=[claim(a, earlier) for a in answers if a.hypothesis.figure == CONCLUSIONS],
        claims=[claim(a, earlier) for a in answers if a.hypothesis.figure != CONCLUSIONS],
        contrasts=[contrast_row(a, finding) for a in (*answers, *explored) for finding in a.findings],
        explored=[claim(a, earlier) for a in explored],
        arm_columns=("part", "pair", "arm", "seeds", *ARM_METRICS),
        arms=arm_cells(arms),
        similar=[
            {**row, "similarity": number(row["similarity"]), "paper": number(row["paper"])} for row in similar
        ],
        equation=EQUATION,
        figures=[shown(f) for f in figures if not f.folded],
        forests=[shown(f) for f in figures if f.folded],
        broken=[(str(path), reason) for path, reason in study.broken],
    )
