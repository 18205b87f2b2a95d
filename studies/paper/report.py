"""What a report says of the claims: claims.csv, what is printed, and the words of paper.html."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.config.errors import one_line
from ship_trl.files.untrusted import Cells, read_table
from ship_trl.study.claims import Verdicts
from ship_trl.study.compare import MIN_SEEDS
from ship_trl.study.plan import PAIRS
from ship_trl.study.statistics import Estimate
from ship_trl.study.study import Study
from studies.paper.contrasts import SPREAD
from studies.paper.judge import (
    CONCLUSION,
    EXPLORATORY,
    Answer,
    Claim,
    Finding,
    Graded,
    Verdict,
    count_grades,
    explore,
    grade_all,
    judge_all,
    look_level,
    min_detectable_effect,
)

# A copy of the claims.csv of an earlier study in a study's folder: its verdicts are named too.
EARLIER = "earlier.csv"
# Verdict and sentence of each claim in an earlier study.
Earlier = Mapping[str, tuple[str, str]]
# A table of a hundred contrasts has 50,000 bytes.
MAX_BYTES = 10_000_000
# Titles of the families of claims that no figure of the paper shows.
FAMILIES = {CONCLUSION: "Conclusions", EXPLORATORY: "What explains them"}
# The bars of contrasts reach at most this multiple of the largest estimate.
MAX_REACH = 2.5
# The values between which bars are drawn.
Scale = tuple[float, float]


def report(study: Study, folder: Path, claims: Sequence[Claim], explored: Sequence[Claim]) -> Verdicts:
    """Judge and grade claims, and judge those that are `explored`, which have no grade, each alone."""
    earlier = read_verdicts(folder / EARLIER) if (folder / EARLIER).exists() else {}
    answers, others = judge_all(study, claims), explore(study, explored)
    grades = grade_all(study, claims)
    counted = count_grades([graded.grade for graded in grades.values()])
    graded = f"Grades: {', '.join(f'{count} {grade}' for grade, count in counted.items())}."
    levels = sorted({(one.seeds, one.level) for one in answers if one.findings})
    shares = ", ".join(f"{100 - 200 * level:.4g} % after {seeds} seeds" for seeds, level in levels)
    intervals = (
        f"Each interval is at the level of the look that its claim was judged at: {shares or 'none yet'}."
    )
    if (count := len(study.looks)) > 1:
        intervals += (
            f" The levels are O'Brien and Fleming's: all {count} looks together err as often as one at 95 %."
        )
    looks = []
    for number, count in enumerate(study.looks, 1):
        level = look_level(number, len(study.looks))
        looks.append((count, level, min_detectable_effect(count, level) if count >= MIN_SEEDS else None))
    shown = {
        "looks": looks,
        "least": MIN_SEEDS,
        "intervals": intervals,
        "decided": [one for one in answers if one.decided],
        "conclusions": [one for one in answers if one.claim.figure == CONCLUSION],
        "claims": [one for one in answers if one.claim.figure != CONCLUSION],
        "explored": others,
        "grades": grades,
        "graded": graded,
        "families": list(families([*answers, *others])),
        "unit": unit,
        "percent": percent,
        "describe": partial(in_a_sentence, earlier=earlier),
    }
    rows = [row for one in (*answers, *others) for row in claim_rows(one, grades.get(one.claim.name))]
    return Verdicts(rows, list(lines_of(study, answers, grades, graded)), shown)


def lines_of(
    study: Study, answers: Sequence[Answer], grades: Mapping[str, Graded], graded: str
) -> Iterator[str]:
    """Yield the lines that are printed."""
    for one in answers:
        if one.findings:
            name = one.claim.name
            yield f"{name:<3}  {one.word:<13} {grades[name].grade:<15} {one.claim.sentence}"
    if without := [one.claim.name for one in answers if not one.findings]:
        yield f"no runs: {', '.join(without)}"
    yield graded
    seeds = {key[3] for key in study.records if key[0] == PAIRS}
    judged = set(study.seeds[: study.whole_looks[-1]])
    if later := seeds & set(study.seeds) - judged:
        yield (
            f"Claims are those of the look after {len(judged)} seeds; figures and arms.csv have "
            f"{len(later)} more, which the next look judges."
        )
    if len(seeds) < MIN_SEEDS:
        yield f"fewer than {MIN_SEEDS} seeds: every verdict is inconclusive"


def claim_rows(answer: Answer, graded: Graded | None) -> Iterator[dict[str, Any]]:
    """Yield a row for each contrast of a claim, or one if it has no runs; what is explored has no grade."""
    claim = answer.claim
    head: dict[str, Any] = {
        "claim": claim.name,
        "figure": claim.figure,
        "sentence": claim.sentence,
        "claim's verdict": answer.word,
        "claim's p": answer.p if answer.findings else "",
        "decided after seeds": answer.decided or "",
        "seeds wanted": answer.seeds_wanted() or "",
    }
    for one in answer.findings or (Finding(Estimate(nan, nan, nan)),):
        found, parts = one.found, graded.parts if graded else {}
        cells: dict[str, Any] = {
            "contrast": found.what,
            "metric": found.metric,
            "estimate": found.value,
            "estimate low": found.low,
            "estimate high": found.high,
            "claimed": one.claimed.value,
            "p": found.p,
            "p against": found.against,
            "p against adjusted": one.adjusted,
            "margin": found.margin,
            "p beyond margin": found.within,
            "seeds": found.seeds,
            "seen alone": one.min_detectable(answer.level),
            "seen adjusted": one.min_detectable(answer.level / answer.claims),
            "verdict": one.verdict.value,
            "beside": "; ".join(f"{name} {by.value:+.3f}" for name, by in found.beside.items()),
        }
        cells = cells if answer.findings else dict.fromkeys(cells, "")
        part = parts.get(found.what, "")
        yield head | cells | {"grade": graded.grade.value if graded else "", "part": part}


def read_verdicts(path: Path) -> dict[str, tuple[str, str]]:
    """Read verdict and sentence of each claim from a report's claims.csv.

    Raises:
        ConfigError: the file is not such a table.
    """
    allowed = [*(verdict.value for verdict in Verdict), "no runs"]

    def read(row: Cells) -> tuple[str, tuple[str, str]]:
        verdict = row["claim's verdict"]
        if verdict not in allowed:
            raise ValueError(f"it has the verdict {verdict!r:.50}; allowed: {', '.join(allowed)}")
        return row["claim"], (verdict, one_line(row["sentence"]))

    names = "claim", "claim's verdict", "sentence"
    return dict(read_table(path, names, read, MAX_BYTES, "folder", "a report's claims.csv"))


def unit(finding: Finding) -> str:
    """Return the unit of a contrast: only contrasts with the same unit share a scale."""
    return finding.found.metric if finding.found.metric in (SPREAD, "start") else "difference"


def scale_of(findings: Sequence[Finding]) -> Scale:
    """Return the scale of contrasts: it holds zero, all estimates, and intervals up to `MAX_REACH`."""
    found = [one.found for one in findings]
    most = MAX_REACH * max(0.01, *(max(abs(one.value), one.margin or 0.0) for one in found))
    ends = np.clip([(one.low, one.high) for one in found], -most, most)
    low, high = min(ends.min(), 0.0), max(ends.max(), 0.0)
    room = 0.03 * (high - low) or most
    return low - room, high + room


def percent(value: float, scale: Scale) -> float:
    """Return where a value lies on a scale, clipped to 0 to 100."""
    return round(float(np.interp(value, scale, (0, 100))), 2)


def families(answers: Sequence[Answer]) -> Iterator[tuple[str, list[Answer], dict[str, Scale]]]:
    """Yield the title of each family of claims, its claims, and the scales of their contrasts by unit."""
    for figure in dict.fromkeys(answer.claim.figure for answer in answers):
        family = [answer for answer in answers if answer.claim.figure == figure]
        found = [finding for answer in family for finding in answer.findings]
        if found:
            scales = {name: scale_of([f for f in found if unit(f) == name]) for name in map(unit, found)}
            yield FAMILIES.get(figure, f"Figure {figure}"), family, scales


def in_a_sentence(answer: Answer, earlier: Earlier) -> str:
    """Say what was measured of a claim, in one contrast or all, and the verdict of an earlier study on it."""
    findings, words = answer.findings, "No runs."
    if len(findings) == 1:
        one = findings[0].found
        words = f"{one.what}: {one.value:+.3f} ({one.interval()}), p {one.p:.3f}"
    elif findings:
        found = Counter(finding.verdict.value for finding in findings)
        counts = ", ".join(f"{count} {verdict}" for verdict, count in found.most_common())
        values = [finding.found.value for finding in findings]
        agreeing = sum(finding.as_claimed for finding in findings)
        largest = max(finding.found.p for finding in findings)
        words = f"{len(findings)} contrasts: {counts}; {agreeing} estimated as claimed"
        words += f" ({min(values):+.3f} to {max(values):+.3f}); largest p {largest:.3f}"
    if findings:
        words += f"; adjusted {answer.p:.3f} for the verdict."
    if answer.decided:
        words += f" Decided after {answer.decided} seeds."
    # If a claim is open although each contrast holds alone, all contrasts miss the adjusted level.
    unsure = [f for f in findings if f.verdict is Verdict.inconclusive]
    if not answer.decided and all(f.verdict is Verdict.supported for f in findings):
        unsure = findings
    if known := [f for f in unsure if isfinite(f.found.error)]:
        alone, adjusted = ([f.min_detectable(answer.level / m) for f in known] for m in (1, answer.claims))
        words += f" Could see differences from {ends(alone)} on, adjusted {ends(adjusted)}."
    if wanted := answer.seeds_wanted():
        words += f" {wanted} seeds would tell differences of the margin from none, four times in five."
    if findings and answer.missing:
        count = len(answer.claim.tests)
        words += f" Still without {answer.seeds} seeds: {answer.missing} of {count} contrasts."
    if answer.claim.name in earlier:
        verdict, sentence = earlier[answer.claim.name]
        # The earlier claim may have had another sentence.
        of = "" if sentence == answer.claim.sentence else f', of "{sentence}"'
        words += f" An earlier study, by its own rules{of}: {verdict}."
    return words


def ends(values: Sequence[float]) -> str:
    """Format the least and the largest value."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"
