"""Draw a chart of paths, north up: own ship under each policy, the target ships, start and goal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim.cases import Case
from ship_trl.view.chart import add_legend, save, tidy
from ship_trl.view.palette import CHART_SERIES, GOAL, OTHERS, SHIPS
from ship_trl.view.telemetry import Telemetry, measure_episode
from ship_trl.view.words import circle_names, counted, number

ENDS = {"collision": ("x", "ends in a collision"), "timeout": ("|", "ends by the time limit")}
# Seconds between marks on a path, and metres around everything.
MARK_TIME, MARGIN = 10.0, 70.0
# Panels in a row, and the inches of one: wider where there are few.
COLUMNS, PANEL, MIN_WIDTH = 5, 3.0, 5.5
COLOUR = CHART_SERIES[0]


def draw_trajectories(
    path: Path, case: Case, world: World, episodes: Mapping[str, Sequence[Episode]]
) -> None:
    """Write a PNG with a panel for each group of episodes, in which all other episodes are grey."""
    groups = {name: [measure_episode(case, world, one) for one in some] for name, some in episodes.items()}
    paths = [one for group in groups.values() for one in group]
    expected, _ = circle_names(world)
    rows = math.ceil(len(groups) / COLUMNS)
    columns = math.ceil(len(groups) / rows)
    width = max(PANEL, MIN_WIDTH / columns)
    size = (width * columns, 1.75 * width * rows + 1)
    figure = Figure(figsize=size, dpi=120, layout="constrained")
    panels: list[Axes] = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat)
    for axes in panels[len(groups) :]:
        axes.set_visible(False)
    for axes, (name, group) in zip(panels, groups.items(), strict=False):
        _set_limits(axes, paths)
        axes.plot(
            *paths[0].states[0, :2], "ko", fillstyle="none", markersize=9, mew=2, zorder=5, label="start"
        )
        goal = (case.goal[0], case.goal[1])
        axes.plot(*goal, "*", color=GOAL, markersize=15, zorder=5, label=f"goal and {expected}")
        axes.add_patch(Circle(goal, world.goal_distance, facecolor=GOAL, alpha=0.12, zorder=1))
        axes.add_patch(Circle(goal, world.goal_distance, fill=False, edgecolor=GOAL, zorder=1))
        _draw_ships(axes, max(paths, key=lambda one: one.steps))
        axes.set(xlabel="east, m", ylabel="north, m")
        axes.label_outer()
        result = number(float(np.mean([one.total[-1] for one in group])), ".1f")
        if len(group) == 1:
            result = f"return {result}, {group[0].outcome}"
        else:
            goals = sum(one.outcome == "goal" for one in group)
            result = f"{counted(len(group), 'seed')}, mean {result}, goal {goals}"
        axes.set_title(f"{name}\n{result}", fontsize=10, loc="left", parse_math=False)
        for one in paths if len(groups) > 1 else ():
            label = "the other policies"
            axes.plot(*one.states[:, :2].T, color=OTHERS, linewidth=0.8, zorder=1, label=label)
        for one in group:
            _draw_path(axes, one, is_thin=len(group) > 1)
    add_legend(figure, panels, "left", 2 if columns < 3 else 3, 9.5)
    title = f"case {case.name}"
    figure.suptitle(title, fontsize=13, fontweight="bold", x=0.01, ha="left", parse_math=False)
    save(figure, path)


def _draw_path(axes: Axes, one: Telemetry, is_thin: bool) -> None:
    """Draw a path, the safe distance at its closest approach to a ship, and a bad end."""
    alpha, own, size = 0.45 if is_thin else 1.0, one.states[:, :2], 3 if is_thin else 5
    label = f"path with a mark every {MARK_TIME:g} s"
    every = max(1, round(MARK_TIME / one.world.dt))
    axes.plot(*own.T, "o-", c=COLOUR, markevery=every, zorder=4, ms=size, lw=size / 3, label=label)
    closest = one.closest_places()
    if closest is not None:
        x, y = closest[0].tolist()
        radius = one.world.safe_distance
        axes.add_patch(Circle((x, y), radius, fill=False, edgecolor=COLOUR, zorder=3, alpha=alpha))
        label = f"closest approach, circle {radius:g} m"
        style: dict[str, Any] = {"marker": ".", "markersize": 7, "markevery": [1], "linewidth": 1}
        axes.plot(*np.stack(closest).T, color=COLOUR, alpha=alpha, zorder=5, label=label, **style)
    if one.outcome in ENDS:
        marker, label = ENDS[one.outcome]
        axes.plot(*own[-1], marker, color=COLOUR, markersize=13, mew=3, zorder=6, label=label)


def _draw_ships(axes: Axes, longest: Telemetry) -> None:
    """Draw the target ships' paths, and number each where it enters the picture."""
    every = max(1, round(MARK_TIME / longest.world.dt))
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    inset = 0.04 * (high[1] - low[1])
    badge = {"boxstyle": "circle,pad=0.25", "facecolor": SHIPS, "edgecolor": "none"}
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 10, "fontweight": "bold"}
    for k, places in enumerate(longest.ships.swapaxes(0, 1), 1):
        label = "target ship, numbered"
        axes.plot(*places.T, "o-", c=SHIPS, lw=1.2, ms=3.5, markevery=every, zorder=2, label=label)
        inside = ((places > low + inset) & (places < high - inset)).all(1)
        if inside.any():
            x, y = places[inside.argmax()]
            axes.text(x, y, f"{k}", color="white", bbox=badge, zorder=7, **style)


def _set_limits(axes: Axes, paths: Sequence[Telemetry]) -> None:
    """Show own ship's paths whole, with sides of at most 2 to 1."""
    case, reach = paths[0].case, paths[0].world.goal_distance
    above, below = (case.goal[0], case.goal[1] + reach), (case.goal[0], case.goal[1] - reach)
    places = np.concatenate([[above, below], *(one.states[:, :2] for one in paths)])
    low, high = places.min(0) - MARGIN, places.max(0) + MARGIN
    sides = high - low
    more = np.maximum(0, 0.5 * sides[::-1] - sides) / 2
    axes.set_xlim(low[0] - more[0], high[0] + more[0])
    axes.set_ylim(low[1] - more[1], high[1] + more[1])
    axes.set_aspect("equal")
    tidy(axes)
