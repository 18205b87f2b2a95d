"""The report as one page of HTML that needs no other file, and its verdicts as Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from ship_trl.study.claims.grades import Graded, count_grades
from ship_trl.study.claims.hypotheses import EXPLORATORY
from ship_trl.study.claims.hypotheses import FIGURE as CONCLUSIONS
from ship_trl.study.claims.verdicts import Answer
from ship_trl.study.compare import MIN_SEEDS, SPREAD, Finding, Verdict
from ship_trl.study.metrics import THRESHOLDS
from ship_trl.study.report.tables import EQUATION
from ship_trl.study.rules import describe_rules
from ship_trl.study.statistics import look_level, min_detectable_effect
from ship_trl.study.study import Study

# Verdict and sentence of each claim in an earlier study.
Earlier = Mapping[str, tuple[str, str]]
# Titles of the families of claims that no figure of the paper shows.
FAMILIES = {CONCLUSIONS: "Conclusions", EXPLORATORY: "What explains them"}
# The bars of contrasts reach at most this multiple of the largest estimate.
MAX_REACH = 2.5


@dataclass(frozen=True)
class Scale:
    """The values between which bars are drawn."""

    low: float
    high: float

    def percent(self, value: float) -> float:
        """Return where a value lies, clipped to 0 to 100."""
        return round(float(np.interp(value, (self.low, self.high), (0, 100))), 2)


def unit(finding: Finding) -> str:
    """Return the unit of a contrast: only contrasts with the same unit share a scale."""
    return finding.metric if finding.metric in (SPREAD, "start") else "difference"


def scale_of(findings: Sequence[Finding]) -> Scale:
    """Return the scale of contrasts: it holds zero, all estimates, and intervals up to `MAX_REACH`."""
    most = MAX_REACH * max(0.01, *(max(abs(f.estimate.value), f.margin or 0.0) for f in findings))
    ends = np.clip([(f.estimate.low, f.estimate.high) for f in findings], -most, most)
    low, high = min(ends.min(), 0.0), max(ends.max(), 0.0)
    room = 0.03 * (high - low) or most
    return Scale(low - room, high + room)


def families(answers: Sequence[Answer]) -> Iterator[tuple[str, list[Answer], dict[str, Scale]]]:
    """Yield the title of each family of claims, its claims, and the scales of their contrasts by unit."""
    for figure in dict.fromkeys(answer.hypothesis.figure for answer in answers):
        family = [answer for answer in answers if answer.hypothesis.figure == figure]
        found = [finding for answer in family for finding in answer.findings]
        if found:
            scales = {name: scale_of([f for f in found if unit(f) == name]) for name in map(unit, found)}
            yield FAMILIES.get(figure, f"Figure {figure}"), family, scales


def in_a_sentence(answer: Answer) -> str:
    """Say what was measured of a claim: its contrast, or how its contrasts came out."""
    findings = answer.findings
    if not findings:
        return "No runs."
    if len(findings) == 1:
        (one,) = findings
        words = f"{one.what}: {one.estimate.value:+.3f} ({one.estimate.interval()}), p {one.p:.3f}"
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
    # If a claim is open although each contrast holds alone, all contrasts miss the adjusted level.
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


def describe_claim(answer: Answer, earlier: Earlier) -> str:
    """Say what was measured of a claim, and the verdict of an earlier study on it."""
    words = in_a_sentence(answer)
    if answer.hypothesis.name in earlier:
        verdict, sentence = earlier[answer.hypothesis.name]
        # The earlier claim may have had another sentence.
        of = "" if sentence == answer.hypothesis.sentence else f', of "{sentence}"'
        words += f" An earlier study, by its own rules{of}: {verdict}."
    return words


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


def describe_grades(grades: Mapping[str, Graded]) -> str:
    """Say how many claims have each grade."""
    counted = count_grades([graded.grade for graded in grades.values()])
    return f"Grades: {', '.join(f'{count} {grade}' for grade, count in counted.items())}."


def as_markdown(answers: Sequence[Answer], grades: Mapping[str, Graded], earlier: Earlier, looks: int) -> str:
    """Return all verdicts and grades as Markdown: the level of the intervals, counts, then a table."""
    lines = [describe_intervals(answers, looks), "", describe_grades(grades), ""]
    lines += ["| claim | verdict | grade | the paper | measured |", "| --- | --- | --- | --- | --- |"]
    for answer in answers:
        name, sentence = answer.hypothesis.name, answer.hypothesis.sentence
        cells = [name, answer.word, grades[name].grade, sentence, describe_claim(answer, earlier)]
        # "|" would end the cell, and "<" could begin a tag.
        cells = [words.replace("|", "/").replace("<", "&lt;") for words in cells]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def render(
    study: Study,
    answers: Sequence[Answer],
    explored: Sequence[Answer],
    grades: Mapping[str, Graded],
    earlier: Earlier,
    **shown: Any,
) -> str:
    """Return the page with the paper's claims and our own contrasts (`explored`), which have no grade.

    `shown` goes to the template as it is: `arms` and `similar` are rows of tables, `pictures` the figures,
    `missing` the number of planned runs without a result.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    describe = partial(describe_claim, earlier=earlier)
    environment.filters |= {"unit": unit, "isfinite": isfinite, "describe": describe}
    records = study.records.values()
    computed = study.computed()
    words = {
        key: f"{key}: {', '.join(f'{value} ({count})' for value, count in counts.items())}"
        for key, counts in computed.items()
    }
    looks = []
    for number, count in enumerate(study.looks, 1):
        level = look_level(number, len(study.looks))
        looks.append((count, level, min_detectable_effect(count, level) if count >= MIN_SEEDS else None))
    return environment.get_template("page.html").render(
        shown,
        runs=len(records),
        profile=", ".join(sorted({r.profile for r in records})),
        episodes=", ".join(sorted({str(len(r.training.returns)) for r in records})),
        seeds=len({key[3] for key in study.records}),
        threshold=THRESHOLDS[0],
        rules=describe_rules(study.plan.rules),
        mixed=[words[key] for key, counts in computed.items() if len(counts) > 1],
        computed=list(words.values()),
        looks=looks,
        least=MIN_SEEDS,
        intervals=describe_intervals(answers, len(looks)),
        decided=[answer for answer in answers if answer.decided],
        conclusions=[answer for answer in answers if answer.hypothesis.figure == CONCLUSIONS],
        claims=[answer for answer in answers if answer.hypothesis.figure != CONCLUSIONS],
        explored=explored,
        grades=grades,
        graded=describe_grades(grades),
        families=list(families([*answers, *explored])),
        equation=EQUATION,
        broken=study.broken,
    )
