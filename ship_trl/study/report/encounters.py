"""The encounters of a study: own ship, its goal, and where target ships go."""

from __future__ import annotations

import math
from collections.abc import Iterator

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.study.report import style
from ship_trl.study.study import Study
from ship_trl.view.style import BLACK, CHART_SERIES

OWN, TARGET = CHART_SERIES[0], CHART_SERIES[2]
# Seconds of a target ship's way that are drawn, and between its dots.
SHOWN, DOT = 40, 10


def cases_of(study: Study, world: World) -> Iterator[Case]:
    """Yield the cases that runs begin with, as far as their files are here and the same."""
    for name, fingerprint in study.plan.cases.items():
        try:
            case = load_case(name, world)
        except ConfigError:
            continue
        if case.fingerprint == fingerprint:
            yield case


def draw_cases(study: Study) -> Figure | None:
    """Draw a map of each case; None where none is here."""
    world = load_world()
    if not (cases := [*cases_of(study, world)]):
        return None
    columns = min(2, len(cases))
    rows = math.ceil(len(cases) / columns)
    figure = Figure((style.NARROW, 2.3 * rows), dpi=style.NARROW_DPI)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in panels[len(cases) :]:
        axis.set_axis_off()
    for axis, case in zip(panels, cases, strict=False):
        draw_case(axis, case, world)
    return figure


def draw_case(axis: Axes, case: Case, world: World) -> None:
    """Draw a case: arrows begin where ships do."""
    (x, y), (goal_x, goal_y) = case.start, case.goal
    axis.plot((x, goal_x), (y, goal_y), color=OWN, linestyle=":", linewidth=0.8)
    axis.add_patch(Circle((goal_x, goal_y), world.goal_distance, fill=False, color=OWN))
    axis.add_patch(Circle((x, y), world.safe_distance, fill=False, color=BLACK, linewidth=0.6))
    speed, _ = world.actions[world.straight_action]
    arrows = [(x, y, case.heading, speed * DOT, OWN)]
    for ship in case.target_ships:
        east, north = (turn(math.radians(ship.heading)) * ship.speed for turn in (math.cos, math.sin))
        times = range(DOT, SHOWN + 1, DOT)
        track = [ship.x + east * time for time in times], [ship.y + north * time for time in times]
        axis.plot(*track, "o", color=TARGET, markersize=2)
        arrows.append((ship.x, ship.y, ship.heading, ship.speed * DOT, TARGET))
    for x, y, heading, length, colour in arrows:
        end = x + length * math.cos(math.radians(heading)), y + length * math.sin(math.radians(heading))
        arrow = {"arrowstyle": "-|>", "color": colour}
        axis.annotate("", end, (x, y), arrowprops=arrow, annotation_clip=False)
        axis.plot(x, y, "o", color=colour, markersize=3)
    axis.set(title=f"case {case.name}", xlabel="east (m)", ylabel="north (m)", aspect="equal")
    axis.margins(0.15)
    axis.autoscale_view()
