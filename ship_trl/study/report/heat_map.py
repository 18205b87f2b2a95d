"""A heat map of what transfer gains over learning from scratch, by source, target and arm."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ship_trl.study.analysis.metrics import measure
from ship_trl.study.analysis.statistics import interquartile_mean
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.kinds import FE, FT
from ship_trl.study.plan.config import CONTROL_ARMS, NEW_CASE, REUSED_ARM, REUSED_CASE, read
from ship_trl.study.plan.jobs import (
    ALONE,
    COMPARED,
    CONTROLS,
    FURTHER_SOURCES,
    LOW,
    OTHER_SOURCES,
    PAIRS,
    from_scratch,
)
from ship_trl.study.report.figures import pairs

ARMS = (*FE, *CONTROL_ARMS, *FT, "FTW")
Place = tuple[str, str, str]


def rows(study: Study) -> dict[str, tuple[Place, dict[str, Place]]]:
    """Find what is compared: by "source to target", the runs from scratch and those of each arm."""
    found: dict[str, tuple[Place, dict[str, Place]]] = {}
    for pair in pairs(study):
        source, target = study.cases(pair)
        arms: dict[str, Place] = {arm: (PAIRS, pair, arm) for arm in ARMS}
        arms |= {arm: (CONTROLS, pair, arm) for arm in CONTROL_ARMS}
        found[f"{source} to {target}"] = from_scratch(PAIRS, pair), arms
    for label in COMPARED:
        values = read("pair", label)
        # Without controls it may be a pair like others.
        itself: dict[str, Place] = {arm: (CONTROLS, label, arm) for arm in ARMS}
        name = f"{values['source']} to {values['target']}"
        found.setdefault(name, (from_scratch(CONTROLS, label), itself))
    label = f"{REUSED_CASE}-{NEW_CASE}"
    reused = {
        f"1, {REUSED_CASE} to {NEW_CASE}": (LOW, label, REUSED_ARM),
        f"{REUSED_CASE} to {NEW_CASE}": (ALONE, label, REUSED_ARM),
        **{
            f"{case} to {NEW_CASE}": (LOW, f"{case}-{NEW_CASE}", REUSED_ARM)
            for case in OTHER_SOURCES + FURTHER_SOURCES
        },
    }
    for name, place in reused.items():
        found[name] = from_scratch(LOW, place[1]), {REUSED_ARM: place}
    return {
        name: (scratch, arms)
        for name, (scratch, arms) in found.items()
        if study.arm(*scratch) and any(study.arm(*place) for place in arms.values())
    }


def gain(study: Study, place: Place, scratch: Place) -> float:
    """Interquartile mean of the difference of areas; not a number without seeds that both have."""
    runs = study.matched({"arm": place, "scratch": scratch})
    areas = [[measure(run, "area") for run in runs[name]] for name in ("arm", "scratch")]
    differences = np.array(areas[0]) - np.array(areas[1])
    return float(interquartile_mean(differences)) if len(differences) else np.nan


def draw_gains(study: Study) -> Figure | None:
    """Draw the heat map; None without runs from scratch to compare with."""
    found = rows(study)
    if not found:
        return None
    values = np.array(
        [
            [gain(study, arms[arm], scratch) if arm in arms else np.nan for arm in ARMS]
            for scratch, arms in found.values()
        ]
    )
    figure = Figure(figsize=(11, 1.4 + 0.45 * len(found)), dpi=110, layout="constrained")
    axes = figure.subplots()
    most = max(0.05, float(np.nanmax(np.abs(values), initial=0.0)))
    picture = axes.imshow(values, cmap=mpl.colormaps["PuOr"], vmin=-most, vmax=most, aspect="auto")
    axes.set_xticks(range(len(ARMS)), [arm.replace("-", "\n") for arm in ARMS])
    axes.set_yticks(range(len(found)), list(found))
    axes.set_ylabel("source to target")
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "white" if abs(value) > 0.6 * most else "black"
            axes.text(column, row, f"{value:+.2f}", ha="center", va="center", color=colour)
    figure.colorbar(picture, ax=axes, label="above scratch (score)")
    return figure
