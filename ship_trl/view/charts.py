"""Charts: learning curves of a run, beside runs from scratch, and of many arms; paths of episodes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from ship_trl.config.bounds import NAUTICAL_MILE
from ship_trl.config.errors import counted
from ship_trl.config.types import World
from ship_trl.files.curve import COLUMNS as CURVE_COLUMNS
from ship_trl.files.curve import Row, moving_mean
from ship_trl.files.record import RunRecord
from ship_trl.learn.rollout import Episode
from ship_trl.sim.cases import Case
from ship_trl.sim.scale import Scale
from ship_trl.sim.state import GOAL_X, GOAL_Y
from ship_trl.view import style
from ship_trl.view.episode import Telemetry, measure_episode

# The least episodes in a moving mean of training returns, and its share of a long run, where 25
# would be a band; and the most points of an outcome.
MEAN_OVER, MEAN_SHARE, MAX_POINTS = 25, 1 / 200, 5_000
# Collisions cost 300 and more; only returns above this differ between policies that reach the goal.
LOWEST_GREEDY = -100.0
# Inches of a panel of a comparison, and panels in a row.
PANEL_SIZE, COLUMNS = (5.2, 6.4), 3
# Letters in a row of a panel's legend, and those that the line of an entry takes.
LEGEND_LETTERS, SAMPLE_LETTERS = 84, 9
ENDS = {"collision": ("x", "ends in a collision"), "timeout": ("|", "ends by the time limit")}
# Seconds between marks on a path, and metres around everything.
MARK_TIME, MARGIN = 10.0, 70.0
# Panels in a row, and the inches of one: wider where there are few.
PATHS_COLUMNS, PATHS_WIDTH, PATHS_MIN_WIDTH = 5, 3.0, 5.5
# Diameter of a ship's number, as a share of the narrowest panel's width.
BADGE = 0.1

Returns = NDArray[np.float64]


# The runs of an arm, one for each seed, by its name.
Groups = Mapping[str, Sequence[RunRecord]]


@matplotlib.rc_context(style.CHART)
def draw_curve(path: Path, rows: Sequence[Row], best_return: float | None, title: str) -> None:
    """Write the learning curve of one run as a PNG of 1200 x 800; `rows` are those of its `curve.csv`.

    Greedy evaluations of several episodes have success rates in place of outcomes. Without a `best_return`
    there is no line for it.
    """
    figure = Figure(figsize=(12, 8), dpi=100)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    lines = pd.DataFrame(list(rows), columns=list(CURVE_COLUMNS))
    finished, evaluated = (lines[lines[name].notna()] for name in ("return", "greedy_return"))
    has_rates = evaluated["greedy_episodes"].max() > 1
    figure.suptitle(title, fontsize=15, fontweight="bold")
    for outcome, (colour, marker) in style.CHART_OUTCOMES.items():
        look: style.Style = {"linestyle": "", "marker": marker, "color": colour}
        trained = finished.loc[finished["outcome"] == outcome, ["episode", "return"]].to_numpy()
        every = max(1, math.ceil(len(trained) / MAX_POINTS))
        drawn = f", 1 in {every} drawn" if every > 1 else ""
        # The legend also lists an outcome that never happened.
        label = f"training: {outcome} ({len(trained)}{drawn})"
        upper.plot(*trained[::every].T, markersize=4, alpha=0.4, label=label, **look)
        ended = evaluated["greedy_outcome"] == outcome
        greedy = evaluated.loc[ended, ["episode", "greedy_return"]].to_numpy()
        if len(greedy) and not has_rates:
            # A cross consists only of its edge.
            edge = colour if marker == "x" else style.BLACK
            label = f"greedy: {outcome} ({len(greedy)})"
            upper.plot(*greedy.T, markersize=7, mec=edge, zorder=4, label=label, **look)
    window = mean_window(len(finished))
    episodes, mean = finished["episode"], moving_mean(finished["return"], window)
    label = f"training: mean of {window}"
    upper.plot(episodes, mean, color=style.CHART_SERIES[0], linewidth=2.2, label=label)
    steps, returns = evaluated["episode"], evaluated["greedy_return"]
    label = "greedy evaluation, mean" if has_rates else "greedy evaluation"
    upper.step(steps, returns, where="post", color=style.BLACK, linewidth=1.2, label=label)
    if has_rates:
        label, rates = "greedy share of goals", evaluated["greedy_success_rate"]
        lower.step(steps, rates, where="post", color=style.BLACK, linewidth=1.2, label=label)
    upper.set_ylabel("return of an episode (undiscounted raw reward)")
    if best_return is not None:
        best = f"best known: {best_return:.1f}"
        upper.axhline(best_return, color=style.BEST_KNOWN, linestyle="--", linewidth=1.8, label=best)
    for outcome, line in (("goal", "-"), ("collision", "-.")):
        share = moving_mean(finished["outcome"] == outcome, window)
        look = {"color": style.CHART_OUTCOMES[outcome][0], "linestyle": line}
        lower.plot(episodes, share, label=f"share of {outcome}s, last {window}", **look)
    epsilons = finished["epsilon"].astype(float)
    if epsilons.notna().any():
        label = "exploration rate ε"
        lower.plot(episodes, epsilons, color=style.EPSILON, linestyle=":", linewidth=2, label=label)
    lower.set(ylim=(-0.04, 1.04), ylabel="share (0 to 1)", xlabel="training episodes")
    for axes in (upper, lower):
        axes.margins(x=0.01)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=10.5)
    style.save_figure(figure, path)


def mean_window(episodes: int) -> int:
    """Return the number of episodes in a moving mean, for a run's number of episodes."""
    return max(MEAN_OVER, int(episodes * MEAN_SHARE))


@matplotlib.rc_context(style.CHART)
def draw_transfer(
    path: Path, arm: str, returns: Sequence[float], scratch: Returns, best_return: float | None, title: str
) -> None:
    """Write the training returns of a transfer [E] and of runs from scratch [S, E] as a PNG of 1200 x 750."""
    figure = Figure(figsize=(12, 7.5), dpi=100)
    axes = figure.subplots()
    axes.set_title(f"{title}, beside learning from scratch", fontsize=15, loc="left")
    window = mean_window(scratch.shape[1])
    smooth = moving_mean(scratch, window)
    seeds = counted(len(scratch), "seed")
    if len(scratch) > 1:
        seeds += ", median; band: from the worst to the best"
    label = f"from scratch: {seeds}; mean of all episodes {style.number(scratch.mean(), '.0f')}"
    episodes = np.arange(1, smooth.shape[1] + 1)
    _draw_band(axes, episodes, smooth, label, style.look_of("scratch"), 2.2)
    mean = moving_mean(returns, window)
    label = f"{arm}, this run; mean of all episodes {style.number(float(np.mean(returns)), '.0f')}"
    axes.plot(np.arange(1, len(mean) + 1), mean, **style.look_of(arm), linewidth=2.8, label=label)
    if best_return is not None:
        label = f"best known return: {best_return:.1f}"
        axes.axhline(best_return, color=style.BEST_KNOWN, linestyle=":", linewidth=2.2, label=label)
    axes.set_xlabel("training episodes", fontsize=12)
    axes.set_ylabel(f"training return, mean of the last {window} episodes", fontsize=12)
    axes.margins(x=0.01)
    figure.legend(loc="outside lower left", ncols=1, fontsize=12)
    style.save_figure(figure, path)


@matplotlib.rc_context(style.CHART)
def draw_comparison(path: Path, panels: Mapping[str, Groups]) -> None:
    """Write a PNG with a panel for each pair: training returns above, greedy returns below."""
    columns = min(COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    size = (PANEL_SIZE[0] * columns, PANEL_SIZE[1] * rows)
    figure = Figure(figsize=size, dpi=100)
    places = figure.subfigures(rows, columns, squeeze=False).flat
    for place, (title, groups) in zip(places, panels.items(), strict=False):
        _draw_panel(place, title, groups)
    style.save_figure(figure, path)


def _draw_panel(place: SubFigure, title: str, groups: Groups) -> None:
    best = next(iter(groups.values()))[0].best_known_return
    upper, lower = place.subplots(2, 1, sharex=True)
    upper.set_title(title)
    styles = style.arm_styles(list(groups))
    highest: list[float] = []
    lengths = {name: min(len(run.training.returns) for run in runs) for name, runs in groups.items()}
    window = mean_window(min(lengths.values()))
    for name, runs in groups.items():
        length = lengths[name]
        smooth = moving_mean(np.stack([run.training.returns[:length] for run in runs]), window)
        label = f"{name} ({counted(len(runs), 'seed')})"
        _draw_band(upper, np.arange(1, length + 1), smooth, label, styles[name], 1.8)
        length = min(len(run.greedy.returns) for run in runs)
        greedy = np.stack([run.greedy.returns[:length] for run in runs])
        _draw_band(lower, runs[0].greedy.episode[:length], greedy, name, styles[name], 1.8)
        highest.append(float(np.median(greedy, axis=0).max()))
    for axes in (upper, lower):
        if best is not None:
            axes.axhline(best, color=style.MUTED, linewidth=1, label=f"best known: {best:.1f}")
    # The bound must not hide a whole line.
    lowest = LOWEST_GREEDY if min(highest) > LOWEST_GREEDY else None
    lower.set_ylim(lowest, None if best is None else best + 15)
    lower.set_xlabel("training episodes")
    upper.set_ylabel(f"training return, mean of {window}\n(median of seeds; band: all)")
    shown = "" if lowest is None else f" above {style.number(lowest, '.0f')}"
    lower.set_ylabel(f"greedy return{shown}\n(median of seeds; band: all)")
    lines, names = upper.get_legend_handles_labels()
    in_a_row = max(1, LEGEND_LETTERS // (max(map(len, names)) + SAMPLE_LETTERS))
    place.legend(lines, names, loc="outside lower center", ncols=in_a_row, fontsize=8)


def _draw_band(
    axes: Axes, x: NDArray[np.int64], values: Returns, label: str, look: style.Style, width: float
) -> None:
    """Draw the median of `values` [S, N] over seeds as a line, and their range as a band."""
    axes.plot(x, np.median(values, axis=0), label=label, linewidth=width, **look)
    axes.fill_between(x, values.min(axis=0), values.max(axis=0), color=look["color"], alpha=0.15, lw=0)


@matplotlib.rc_context(style.CHART)
def draw_trajectories(
    path: Path, case: Case, world: World, episodes: Mapping[str, Sequence[Episode]]
) -> None:
    """Write a PNG with a panel for each group of episodes, in which all other episodes are grey."""
    groups = {name: [measure_episode(world, one) for one in some] for name, some in episodes.items()}
    paths = [one for group in groups.values() for one in group]
    expected, _ = style.circle_names(world)
    rows = math.ceil(len(groups) / PATHS_COLUMNS)
    columns = math.ceil(len(groups) / rows)
    width = max(PATHS_WIDTH, PATHS_MIN_WIDTH / columns)
    size = (width * columns, 1.75 * width * rows + 1)
    figure = Figure(figsize=size, dpi=120)
    panels: list[Axes] = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat)
    for axes in panels[len(groups) :]:
        axes.set_visible(False)
    for axes, (name, group) in zip(panels, groups.items(), strict=False):
        _set_limits(axes, paths)
        axes.plot(
            *paths[0].states[0, :2], "ko", fillstyle="none", markersize=9, mew=2, zorder=5, label="start"
        )
        goal = (case.goal[0], case.goal[1])
        axes.plot(*goal, "*", color=style.GOAL, markersize=15, zorder=5, label=f"goal and {expected}")
        axes.add_patch(Circle(goal, world.goal_distance, facecolor=style.GOAL, alpha=0.12, zorder=1))
        axes.add_patch(Circle(goal, world.goal_distance, fill=False, edgecolor=style.GOAL, zorder=1))
        _draw_ships(axes, max(paths, key=lambda one: one.steps))
        axes.set(xlabel="east, m", ylabel="north, m")
        axes.label_outer()
        if case.scale is not None:
            _add_miles(axes, case.scale)
        result = style.number(float(np.mean([one.total[-1] for one in group])), ".1f")
        if len(group) == 1:
            result = f"return {result}, {group[0].outcome}"
        else:
            goals = sum(one.outcome == "goal" for one in group)
            result = f"{counted(len(group), 'seed')}, mean {result}, {goals} at the goal"
        axes.set_title(f"{name}\n{result}", fontsize=10, loc="left")
        for one in paths if len(groups) > 1 else ():
            label = "the other policies"
            axes.plot(*one.states[:, :2].T, color=style.OTHERS, linewidth=0.8, zorder=1, label=label)
        arm = style.arm_in(name)
        colour = style.CHART_SERIES[0] if arm is None else str(style.look_of(arm)["color"])
        for one in group:
            _draw_path(axes, one, colour, is_thin=len(group) > 1)
    style.add_legend(figure, panels, "left", 2 if columns < 3 else 3, 9.5)
    title = f"case {case.name}"
    figure.suptitle(title, fontsize=13, fontweight="bold", x=0.01, ha="left")
    style.save_figure(figure, path)


def _add_miles(axes: Axes, scale: Scale) -> None:
    """Add axes in nautical miles at the top and at the right."""
    miles = scale.length / NAUTICAL_MILE
    both = (lambda metres: metres * miles, lambda found: found / miles)
    about = f"at sea, NM; {MARK_TIME:g} s are {scale.minutes(MARK_TIME)}"
    axes.secondary_xaxis("top", functions=both).set_xlabel(about)
    axes.secondary_yaxis("right", functions=both).set_ylabel("at sea, NM")


def _draw_path(axes: Axes, one: Telemetry, colour: str, is_thin: bool) -> None:
    """Draw a path, the safe distance at its closest approach to a ship, and a bad end."""
    alpha, own, size = 0.45 if is_thin else 1.0, one.states[:, :2], 3 if is_thin else 5
    label = f"path with a mark every {MARK_TIME:g} s"
    every = max(1, round(MARK_TIME / one.world.dt))
    axes.plot(*own.T, "o-", c=colour, markevery=every, zorder=4, ms=size, lw=size / 3, label=label)
    closest = one.closest_places()
    if closest is not None:
        x, y = closest[0].tolist()
        radius = one.world.safe_distance
        axes.add_patch(Circle((x, y), radius, fill=False, edgecolor=colour, zorder=3, alpha=alpha))
        label = f"closest approach, circle {radius:g} m"
        look: style.Style = {"marker": ".", "markersize": 7, "markevery": [1], "linewidth": 1}
        axes.plot(*np.stack(closest).T, color=colour, alpha=alpha, zorder=5, label=label, **look)
    if one.outcome in ENDS:
        marker, label = ENDS[one.outcome]
        axes.plot(*own[-1], marker, color=colour, markersize=13, mew=3, zorder=6, label=label)


def _draw_ships(axes: Axes, longest: Telemetry) -> None:
    """Draw the target ships' paths, and number each where it enters the picture."""
    every = max(1, round(MARK_TIME / longest.world.dt))
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    inset, width, taken = 0.04 * (high[1] - low[1]), high[0] - low[0], list[NDArray[np.float64]]()
    badge = {"boxstyle": "circle,pad=0.25", "facecolor": style.SHIPS, "edgecolor": "none"}
    look: style.Style = {"ha": "center", "va": "center", "fontsize": 10, "fontweight": "bold"}
    for k, places in enumerate(longest.ships.swapaxes(0, 1), 1):
        label = "target ship, numbered"
        axes.plot(*places.T, "o-", c=style.SHIPS, lw=1.2, ms=3.5, markevery=every, zorder=2, label=label)
        inside = places[((places > low + inset) & (places < high - inset)).all(1)]
        # On its own path, but not on another number.
        free = [place for place in inside if all(math.dist(place, other) > BADGE * width for other in taken)]
        if len(inside):
            x, y = place = (free or inside)[0]
            taken.append(place)
            axes.text(x, y, f"{k}", color="white", bbox=badge, zorder=7, **look)


def _set_limits(axes: Axes, paths: Sequence[Telemetry]) -> None:
    """Show own ship's paths whole, with sides of at most 2 to 1."""
    goal, reach = paths[0].states[0, [GOAL_X, GOAL_Y]], np.array([0.0, paths[0].world.goal_distance])
    places = np.concatenate([[goal + reach, goal - reach], *(one.states[:, :2] for one in paths)])
    low, high = places.min(0) - MARGIN, places.max(0) + MARGIN
    sides = high - low
    more = np.maximum(0, 0.5 * sides[::-1] - sides) / 2
    axes.set_xlim(low[0] - more[0], high[0] + more[0])
    axes.set_ylim(low[1] - more[1], high[1] + more[1])
    axes.set_aspect("equal")
