"""A chart of where everybody sailed: own ship under several policies, the target ships, start and goal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.files.disk import replacing
from ship_trl.learn.rollout import Episode
from ship_trl.sim.cases import Case
from ship_trl.sim.transition import Transition
from ship_trl.view.comparison import COLOURS, counted
from ship_trl.view.lettering import number

# Line and marker tell groups apart without colour.
LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
ENDS = {"collision": ("x", "ends in a collision"), "timeout": ("|", "ends by the time limit")}
SHIPS = "#5A5A5A"
GOAL = "#B02020"
# Seconds between time marks, metres around everything.
MARK_TIME = 10.0
MARGIN = 70.0
# Places looked at within a step for the closest approach.
PARTS = 20
INCHES, DOTS = 8.6, 120
# More groups than this are not told apart in one picture.
TOGETHER, COLUMNS, PANEL = 3, 5, 3.0
OTHERS = "#D4D4D4"

Places = NDArray[np.float64]


@dataclass(frozen=True)
class Path2D:
    """One episode on the chart: own ship [T + 1, 2], the ships [T + 1, K, 2], in metres."""

    own: Places
    ships: Places
    outcome: str

    def nearest(self) -> tuple[Places, Places] | None:
        """Find where own ship and the nearest ship were at the closest approach; None without ships."""
        if not self.ships.shape[1]:
            return None
        share = np.linspace(0, 1, PARTS, endpoint=False)[None, :, None]
        own = (self.own[:-1, None] * (1 - share) + self.own[1:, None] * share).reshape(-1, 2)
        own = np.concatenate((own, self.own[-1:]))
        share = share[..., None]
        ships = self.ships[:-1, None] * (1 - share) + self.ships[1:, None] * share
        ships = np.concatenate((ships.reshape(-1, *self.ships.shape[1:]), self.ships[-1:]))
        apart = np.linalg.norm(ships - own[:, None], axis=-1)
        time, ship = divmod(int(apart.argmin()), apart.shape[1])
        return own[time], ships[time, ship]


def draw_trajectories(
    path: Path, case: Case, world: World, sailed: Mapping[str, Sequence[Episode]], title: str = ""
) -> None:
    """Write a PNG: north up, metres on both axes, a mark on every path each 10 s.

    Up to `TOGETHER` groups are drawn over each other. More have a panel each, with the others in grey.

    Args:
        path: where it goes; written beside and renamed.
        case: where all was sailed.
        world: its safe and expected distance.
        sailed: by the name of a group, its episodes; those of a group have one colour, line and marker.
        title: one line above.

    Raises:
        OSError: the file cannot be written.
    """
    motion = Transition(case, world, torch.device("cpu"))
    groups = {name: [_path(motion, episode) for episode in episodes] for name, episodes in sailed.items()}
    everything = [one for paths in groups.values() for one in paths]
    alone = len(groups) > TOGETHER
    columns = math.ceil(len(groups) / math.ceil(len(groups) / COLUMNS)) if alone else 1
    rows = math.ceil(len(groups) / columns) if alone else 1
    size = (PANEL * columns, 1.75 * PANEL * rows + 1) if alone else (INCHES, INCHES + 1.2)
    figure = Figure(figsize=size, dpi=DOTS, layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat)
    every = max(1, round(MARK_TIME / world.dt))
    longest = max(everything, key=lambda one: len(one.own))
    for axes in panels[: len(groups) if alone else 1]:
        _draw_ships(axes, longest, every, not alone)
        _draw_places(axes, case, world, not alone)
        _limit(axes, case, world, [one.own for one in everything], 0.5 if alone else 0.85)
        _number_ships(axes, motion)
    for axes in panels[len(groups) if alone else 1 :]:
        axes.set_visible(False)
    handles = []
    for k, (name, paths) in enumerate(groups.items()):
        axes = panels[k if alone else 0]
        words = _name(name, sailed[name], "\n" if alone else ": ")
        if alone:
            for one in everything:
                axes.plot(*one.own.T, color=OTHERS, linewidth=0.8, zorder=1)
            axes.set_title(words, fontsize=10, loc="left", parse_math=False)
        style = _style(0 if alone else k)
        _draw_group(axes, paths, world, style, every)
        handles.append(Line2D([], [], label=words, linewidth=1.8, **style))
    legend = [] if alone else handles
    legend += _explained(world, bool(case.target_ships), groups, alone)
    figure.legend(
        handles=legend, loc="outside lower left", ncols=2 if columns < 3 else 3, frameon=False, fontsize=9.5
    )
    figure.suptitle(
        title or f"case {case.name}", fontsize=13, fontweight="bold", x=0.01, ha="left", parse_math=False
    )
    for axes in panels:
        axes.set_xlabel("east, m")
        axes.set_ylabel("north, m")
        axes.label_outer()
    with replacing(path) as draft:
        figure.savefig(draft, format="png")


def _path(motion: Transition, episode: Episode) -> Path2D:
    own = episode.states[:, :2]
    ships = motion.away(episode.states) + own[:, None]
    return Path2D(own.double().numpy(), ships.double().numpy(), episode.outcome)


def _name(name: str, episodes: Sequence[Episode], between: str) -> str:
    mean = number(float(np.mean([episode.episode_return for episode in episodes])), ".1f")
    if len(episodes) == 1:
        return f"{name}{between}return {mean}, {episodes[0].outcome}"
    goals = sum(episode.outcome == "goal" for episode in episodes)
    return f"{name}{between}{counted(len(episodes))}, mean {mean}, goal {goals}"


def _style(group: int) -> dict[str, Any]:
    return {
        "color": COLOURS[group % len(COLOURS)],
        "linestyle": LINES[group % len(LINES)],
        "marker": MARKERS[group % len(MARKERS)],
        "markersize": 5,
    }


def _draw_group(axes: Axes, paths: Sequence[Path2D], world: World, style: dict[str, Any], every: int) -> None:
    """Draw the paths of a group, where each was closest to a ship, and those that end badly."""
    many = len(paths) > 1
    for one in paths:
        width = 1.0 if many else 1.8
        axes.plot(
            *one.own.T,
            markevery=every,
            linewidth=width,
            zorder=4,
            **(style | {"markersize": 3 if many else 5}),
        )
        _draw_closest(axes, one, world, style["color"], style["linestyle"], 0.45 if many else 1.0)
        if one.outcome in ENDS:
            axes.plot(
                *one.own[-1], ENDS[one.outcome][0], color=style["color"], markersize=13, mew=3, zorder=6
            )


def _draw_ships(axes: Axes, longest: Path2D, every: int, lettered: bool) -> None:
    for places in longest.ships.swapaxes(0, 1):
        axes.plot(*places.T, "-", color=SHIPS, lw=1.2, marker="o", ms=3.5, markevery=every, zorder=2)
        for k in range(0, len(places), every) if lettered else ():
            axes.annotate(
                f"{k // every * MARK_TIME:g} s",
                places[k],
                xytext=(5, -9),
                textcoords="offset points",
                fontsize=7.5,
                color=SHIPS,
                annotation_clip=True,
            )


def _draw_closest(axes: Axes, one: Path2D, world: World, colour: str, line: str, ink: float) -> None:
    found = one.nearest()
    if found is None:
        return
    own, ship = found
    circle = Circle((own[0], own[1]), world.safe_distance, fill=False, linewidth=1, zorder=3, alpha=ink)
    circle.set(edgecolor=colour, linestyle=line)
    axes.add_patch(circle)
    axes.plot(*np.stack((own, ship)).T, "-", color=colour, linewidth=1, zorder=3, alpha=ink)
    axes.plot(*ship, ".", color=colour, markersize=7, zorder=5, alpha=ink)


def _draw_places(axes: Axes, case: Case, world: World, lettered: bool) -> None:
    start, goal = (case.start[0], case.start[1]), (case.goal[0], case.goal[1])
    axes.plot(*start, "o", color="black", markersize=9, fillstyle="none", mew=2, zorder=5)
    axes.plot(*goal, "*", color=GOAL, markersize=15, zorder=5)
    for place, word, beside in ((start, "start", (9, -12)), (goal, "goal", (10, 6))) if lettered else ():
        axes.annotate(word, place, xytext=beside, textcoords="offset points", fontsize=10)
    axes.add_patch(Circle(goal, world.goal_distance, facecolor=GOAL, alpha=0.12, zorder=1))
    axes.add_patch(Circle(goal, world.goal_distance, fill=False, edgecolor=GOAL, zorder=1))


def _limit(axes: Axes, case: Case, world: World, own: Sequence[Places], least: float) -> None:
    """Show own ship's paths whole; target ships sail on out of the picture."""
    above = np.array([[0.0, world.goal_distance], [0.0, -world.goal_distance]])
    around = [np.array([case.start]), np.array([case.goal]) + above]
    places = np.concatenate([*own, *around])
    low, high = places.min(0) - MARGIN, places.max(0) + MARGIN
    # At least so wide for its height, and the other way round, so that the ships are seen to come.
    sides = high - low
    more = np.maximum(0, least * sides[::-1] - sides) / 2
    axes.set_xlim(low[0] - more[0], high[0] + more[0])
    axes.set_ylim(low[1] - more[1], high[1] + more[1])
    axes.set_aspect("equal")
    axes.grid(color="#E4E4E4", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _number_ships(axes: Axes, motion: Transition) -> None:
    """Write each ship's number where its course comes into the picture."""
    (west, east), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    inset = 0.04 * (top - bottom)
    start, velocity = motion.ship_start.double().numpy(), motion.ship_velocity.double().numpy()
    for k, (place, way) in enumerate(zip(start, velocity, strict=True), 1):
        course = place + np.arange(0, 600, 0.5)[:, None] * way
        inside = (course > (west + inset, bottom + inset)) & (course < (east - inset, top - inset))
        rows = inside.all(1).nonzero()[0]
        if not len(rows):
            continue
        right, up = course[rows[0]].tolist()
        axes.text(
            right,
            up,
            f"{k}",
            ha="center",
            va="center",
            fontsize=10,
            fontweight="bold",
            color="white",
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": SHIPS, "edgecolor": "none"},
            zorder=7,
        )


def _explained(
    world: World, ships: bool, groups: Mapping[str, Sequence[Path2D]], alone: bool
) -> list[Line2D]:
    """Say what is drawn once for all."""
    marks = (
        [_entry("start", "o", color="black", fillstyle="none", markersize=9, markeredgewidth=2)]
        if alone
        else []
    )
    goal = f"goal and expected distance, {world.goal_distance:g} m"
    marks.append(_entry(goal, "*", color=GOAL, markersize=13))
    if alone:
        marks.append(_entry("the other policies", linestyle="-", color=OTHERS))
    if ships:
        closest = f"safe distance, {world.safe_distance:g} m, at the closest approach"
        marks.append(_entry("target ship, numbered", "o", linestyle="-", markersize=3.5))
        marks.append(_entry(closest, "o", fillstyle="none", markersize=13))
    marks.append(
        _entry(
            f"a mark on each path every {MARK_TIME:g} s", **({"marker": "o"} | (_style(0) if alone else {}))
        )
    )
    ended = {one.outcome for paths in groups.values() for one in paths}
    for outcome, (marker, label) in ENDS.items():
        if outcome in ended:
            marks.append(_entry(label, marker, markersize=11, markeredgewidth=3))
    return marks


def _entry(label: str, marker: str = "", **style: Any) -> Line2D:
    return Line2D([], [], **{"label": label, "marker": marker, "linestyle": "", "color": SHIPS} | style)
