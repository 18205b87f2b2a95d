"""Where the runs of each arm lie in a study, by the names that reports and questions use."""

from __future__ import annotations

from ship_trl.study.analysis.study import Places, Study
from ship_trl.study.plan.arms import SCRATCH, SCRATCH_PAIR
from ship_trl.study.plan.config import NEW_CASE, REUSED_ARM, REUSED_CASE
from ship_trl.study.plan.jobs import (
    ALONE,
    CONTROLS,
    FURTHER_SOURCES,
    LOW,
    ONE,
    OTHER_SOURCES,
    PAIRS,
    Place,
    reuse_label,
    scratch_place,
)

# The networks on the new case, with the starting epsilon; one without it starts with the low one. Each "case
# N" was trained on its case alone; the reused network on two cases.
SOURCES = tuple(sorted((REUSED_CASE, *OTHER_SOURCES, *FURTHER_SOURCES)))
REUSED: Places = {
    "reused, low": (LOW, reuse_label(REUSED_CASE), REUSED_ARM),
    "reused, 1": (ONE, reuse_label(REUSED_CASE), REUSED_ARM),
    "scratch, low": (LOW, NEW_CASE, SCRATCH),
    "scratch, 1": (ONE, NEW_CASE, SCRATCH),
    **{
        f"case {case}": (ALONE if case == REUSED_CASE else LOW, reuse_label(case), REUSED_ARM)
        for case in SOURCES
    },
}
# The paper's figure of each pair, in its order.
FIGURES = {"high": "5", "low": "6", "lowest": "7"}


def pairs(study: Study) -> list[str]:
    """Return the pairs of a study: those of the paper in its order, then others."""
    found = sorted({pair for part, pair, _ in study.places if part == PAIRS})
    return [*(pair for pair in FIGURES if pair in found), *(pair for pair in found if pair not in FIGURES)]


def places_of(study: Study) -> dict[str, dict[str, Place]]:
    """Return the places of all arms, by pair, or by "source to target" for a control pair.

    The controls of a pair are among its arms. The arms of a control pair have the runs from scratch of its
    target beside them. The new case has the names of `REUSED`.
    """
    found: dict[str, dict[str, Place]] = {}
    for kind in (PAIRS, CONTROLS):
        for part, label, arm in study.places:
            if part == kind and not (part == CONTROLS and label in SCRATCH_PAIR):
                found.setdefault(label, {})[arm] = (part, label, arm)
    for label in SCRATCH_PAIR:
        own: dict[str, Place] = {place[2]: place for place in study.places if place[:2] == (CONTROLS, label)}
        if own:
            record = next(iter(study.arm(*next(iter(own.values()))).values()))
            scratch = scratch_place(CONTROLS, label)
            base: dict[str, Place] = {SCRATCH: scratch} if study.arm(*scratch) else {}
            found[f"{record.source} to {record.target}"] = base | own
    reused = {name: place for name, place in REUSED.items() if study.arm(*place)}
    return {**found, NEW_CASE: reused} if reused else found
