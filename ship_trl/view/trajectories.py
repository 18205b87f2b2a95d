"""A chart of where everybody sailed: own ship under several policies, the target ships, start and goal."""

from __future__ import annotations

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

from ship_trl.config import World
from ship_trl.learn.rollout import Episode
from ship_trl.paths import replacing
from ship_trl.sim.cases import Case
from ship_trl.sim.transition import Transition
from ship_trl.view.comparison import COLOURS, counted

# Line and marker tell groups apart without colour; with the colours they repeat after 28.
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
    figure = Figure(figsize=(INCHES + 2.6, INCHES), dpi=DOTS, layout="constrained")
    axes = figure.subplots()
    every = max(1, round(MARK_TIME / world.dt))
    longest = max((one for paths in groups.values() for one in paths), key=lambda one: len(one.own))
    _draw_ships(axes, longest, every)
    handles = []
    for k, (name, paths) in enumerate(groups.items()):
        colour, line = COLOURS[k % len(COLOURS)], LINES[k % len(LINES)]
        marker = MARKERS[k % len(MARKERS)]
        style = {"color": colour, "linestyle": line, "marker": marker, "markersize": 5}
        for one in paths:
            axes.plot(*one.own.T, markevery=every, linewidth=1.8, alpha=0.9, zorder=4, **style)  # type: ignore[arg-type]
            _draw_closest(axes, one, world, colour, line)
            if one.outcome in ENDS:
                axes.plot(*one.own[-1], ENDS[one.outcome][0], color=colour, markersize=13, mew=3, zorder=6)
        handles.append(Line2D([], [], label=_name(name, sailed[name]), linewidth=1.8, **style))  # type: ignore[arg-type]
    _draw_places(axes, case, world)
    _limit(axes, case, world, [p.own for paths in groups.values() for p in paths])
    _number_ships(axes, motion)
    axes.legend(
        handles=handles + _explained(world, bool(case.target_ships), groups),
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        frameon=False,
        fontsize=9.5,
    )
    axes.set_title(title or f"case {case.name}", fontsize=13, fontweight="bold", loc="left", parse_math=False)
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    with replacing(path) as draft:
        figure.savefig(draft, format="png")


def _path(motion: Transition, episode: Episode) -> Path2D:
    own = episode.states[:, :2]
    ships = motion.away(episode.states) + own[:, None]
    return Path2D(own.double().numpy(), ships.double().numpy(), episode.outcome)


def _name(name: str, episodes: Sequence[Episode]) -> str:
    returns = [episode.episode_return for episode in episodes]
    if len(episodes) == 1:
        return f"{name}: return {returns[0]:.1f}, {episodes[0].outcome}"
    goals = sum(episode.outcome == "goal" for episode in episodes)
    return f"{name}: {counted(len(episodes))}, mean return {np.mean(returns):.1f}, {goals} reach the goal"


def _draw_ships(axes: Axes, longest: Path2D, every: int) -> None:
    for places in longest.ships.swapaxes(0, 1):
        axes.plot(*places.T, "-", color=SHIPS, lw=1.2, marker="o", ms=3.5, markevery=every, zorder=2)
        for k in range(0, len(places), every):
            axes.annotate(
                f"{k // every * MARK_TIME:g} s",
                places[k],
                xytext=(5, -9),
                textcoords="offset points",
                fontsize=7.5,
                color=SHIPS,
                annotation_clip=True,
            )


def _draw_closest(axes: Axes, one: Path2D, world: World, colour: str, line: str) -> None:
    found = one.nearest()
    if found is None:
        return
    own, ship = found
    axes.add_patch(
        Circle(
            (own[0], own[1]),
            world.safe_distance,
            fill=False,
            edgecolor=colour,
            linestyle=line,
            linewidth=1,
            zorder=3,
        )
    )
    axes.plot(*np.stack((own, ship)).T, "-", color=colour, linewidth=1, zorder=3)
    axes.plot(*ship, ".", color=colour, markersize=7, zorder=5)


def _draw_places(axes: Axes, case: Case, world: World) -> None:
    start, goal = (case.start[0], case.start[1]), (case.goal[0], case.goal[1])
    axes.plot(*start, "o", color="black", markersize=9, fillstyle="none", mew=2, zorder=5)
    axes.annotate("start", start, xytext=(9, -12), textcoords="offset points", fontsize=10)
    axes.plot(*goal, "*", color=GOAL, markersize=15, zorder=5)
    axes.annotate("goal", goal, xytext=(10, 6), textcoords="offset points", fontsize=10)
    axes.add_patch(Circle(goal, world.goal_distance, facecolor=GOAL, alpha=0.12, zorder=1))
    axes.add_patch(Circle(goal, world.goal_distance, fill=False, edgecolor=GOAL, zorder=1))


def _limit(axes: Axes, case: Case, world: World, own: Sequence[Places]) -> None:
    """Show own ship's paths whole; target ships sail on out of the picture."""
    above = np.array([[0.0, world.goal_distance], [0.0, -world.goal_distance]])
    around = [np.array([case.start]), np.array([case.goal]) + above]
    places = np.concatenate([*own, *around])
    low, high = places.min(0) - MARGIN, places.max(0) + MARGIN
    # At least two thirds as wide as high, and the other way round, so that the ships are seen to come.
    sides = high - low
    more = np.maximum(0, 2 / 3 * sides[::-1] - sides) / 2
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
    for number, (place, way) in enumerate(zip(start, velocity, strict=True), 1):
        course = place + np.arange(0, 600, 0.5)[:, None] * way
        inside = (course > (west + inset, bottom + inset)) & (course < (east - inset, top - inset))
        rows = inside.all(1).nonzero()[0]
        if not len(rows):
            continue
        right, up = course[rows[0]].tolist()
        axes.text(
            right,
            up,
            f"{number}",
            ha="center",
            va="center",
            fontsize=10,
            fontweight="bold",
            color="white",
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": SHIPS, "edgecolor": "none"},
            zorder=7,
        )


def _explained(world: World, ships: bool, groups: Mapping[str, Sequence[Path2D]]) -> list[Line2D]:
    """Say what is drawn once for all."""
    marks = [_entry(f"on each path: a mark every {MARK_TIME:g} s")]
    if ships:
        closest = f"safe distance of {world.safe_distance:g} m at the\nclosest approach, line to the ship"
        marks += [
            _entry("target ship, numbered", "o", linestyle="-", markersize=3.5),
            _entry(closest, "o", fillstyle="none", markersize=13),
        ]
    goal = f"goal and expected distance, {world.goal_distance:g} m"
    marks.append(_entry(goal, "*", color=GOAL, markersize=13))
    ended = {one.outcome for paths in groups.values() for one in paths}
    for outcome, (marker, label) in ENDS.items():
        if outcome in ended:
            marks.append(_entry(label, marker, markersize=11, markeredgewidth=3))
    return marks


def _entry(label: str, marker: str = "", **style: Any) -> Line2D:
    return Line2D([], [], **{"label": label, "marker": marker, "linestyle": "", "color": SHIPS} | style)
