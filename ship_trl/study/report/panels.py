"""Which arms stand beside each other in a small panel, always with those from scratch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ship_trl.study.analysis.study import Place, Study
from ship_trl.study.claims.kinds import FE, FT
from ship_trl.study.plan.config import NEW_CASE, REUSED_ARM, REUSED_CASE
from ship_trl.study.plan.jobs import (
    ALONE,
    CONTROLS,
    FURTHER_SOURCES,
    LOW,
    LOW_EPSILON,
    ONE,
    OTHER_SOURCES,
    PAIRS,
    from_scratch,
)
from ship_trl.study.report.figures import LOOKS, Look

NUMBERS = {"high": "5", "low": "6", "lowest": "7"}
REUSE = "Figure 9: reuse on the new case"
# Frozen layers that hold no features.
KINDS = ("random", "permuted")


@dataclass(frozen=True)
class Arm:
    """A line of a panel: its name, where its runs lie in the study, and how it looks."""

    name: str
    place: Place
    look: Look


@dataclass(frozen=True)
class Panel:
    """Some arms, and where the runs from scratch lie that they are compared with."""

    arms: Sequence[Arm]
    scratch: Place


@dataclass(frozen=True)
class Section:
    """Panels under one heading, of a line or more."""

    heading: str
    panels: Sequence[Panel]


def pairs(study: Study) -> list[str]:
    """Pairs that were run: the paper's in its order, then others."""
    found = sorted({pair for part, pair, _, _ in study.records if part == PAIRS})
    return [*(pair for pair in NUMBERS if pair in found), *(pair for pair in found if pair not in NUMBERS)]


def title(study: Study, pair: str) -> str:
    """Of a pair's figure: the paper's number, source and target."""
    name = f"Figure {NUMBERS[pair]}: pair {pair}" if pair in NUMBERS else f"Pair {pair}"
    source, target = study.cases(pair)
    return f"{name}, {f'case {source} to ' if source else ''}case {target}"


def place_of(study: Study, pair: str, arm: str) -> Place:
    """Return where an arm of a pair was run: with the figures, or else with the controls."""
    return (PAIRS if study.arm(PAIRS, pair, arm) else CONTROLS), pair, arm


def panel(study: Study, scratch: Place, arms: Sequence[tuple[str, Place]]) -> Iterator[Panel]:
    """Yield a panel of the arms that have runs, if any has; an arm's look is that of its place among all."""
    found = [
        Arm(name, place, look) for (name, place), look in zip(arms, LOOKS, strict=False) if study.arm(*place)
    ]
    if found:
        yield Panel(found, scratch)


def pair_sections(study: Study, pair: str) -> list[Section]:
    """Panels of one arm each: feature extraction, with its controls, and finetuning."""
    scratch = from_scratch(PAIRS, pair)
    sections: list[Section] = []
    for heading, arms in (("feature extraction", FE), ("finetuning", (*FT, "FTW"))):
        panels = [
            one
            for arm in arms
            for one in panel(
                study,
                scratch,
                [
                    (arm, place_of(study, pair, arm)),
                    *((f"{kind} layers", place_of(study, pair, f"{arm}-{kind}")) for kind in KINDS),
                ],
            )
        ]
        if panels:
            name = heading if sections else f"{title(study, pair)}\n{heading}"
            sections.append(Section(name, panels))
    if not sections and study.arm(*scratch):
        sections.append(Section(title(study, pair), [Panel([], scratch)]))
    return sections


def grouped_sections(study: Study) -> list[Section]:
    """Panels of two arms each: a section for each pair, and one for the new case."""
    sections = []
    for pair in pairs(study):
        groups = (FE[:2], FE[2:], FT[:2], FT[2:], ("FTW",), tuple(f"FE3-{kind}" for kind in KINDS))
        panels = [
            one
            for group in groups
            for one in panel(
                study, from_scratch(PAIRS, pair), [(arm, place_of(study, pair, arm)) for arm in group]
            )
        ]
        sections.append(Section(title(study, pair), panels))
    reused = reuse_panels(study, sources_at_once=2)
    sections.append(Section(REUSE, reused))
    return [section for section in sections if section.panels]


def reuse_panels(study: Study, sources_at_once: int = 1) -> list[Panel]:
    """Panels of the new case: the reused network at both starting epsilons, then sources trained alike."""
    label = f"{REUSED_CASE}-{NEW_CASE}"
    panels = [
        one
        for part, epsilon in ((LOW, LOW_EPSILON), (ONE, 1))
        for one in panel(
            study,
            from_scratch(part, label),
            [(f"reused, \N{GREEK SMALL LETTER EPSILON} {epsilon:g}", (part, label, REUSED_ARM))],
        )
    ]
    cases = sorted((REUSED_CASE, *OTHER_SOURCES, *FURTHER_SOURCES))
    for first in range(0, len(cases), sources_at_once):
        group = [
            (f"case {case}", (ALONE if case == REUSED_CASE else LOW, f"{case}-{NEW_CASE}", REUSED_ARM))
            for case in cases[first : first + sources_at_once]
        ]
        panels += panel(study, from_scratch(LOW, label), group)
    return panels
