"""The look of pictures (dark) and of charts (white): colours, dashes, words and numbers, axes and legends.

The colours and shapes of ships are in `ship_trl.sim.scene`, because the network sees them too.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import RcKeyType

from ship_trl.config.types import World
from ship_trl.files.disk import atomic_write

Colour = tuple[int, int, int]
# Keyword arguments of Matplotlib.
Style = dict[str, Any]

# Pictures, in RGB.
BACKGROUND: Colour = (15, 22, 34)
TEXT: Colour = (232, 238, 245)
FAINT: Colour = (140, 156, 178)
RULE: Colour = (52, 66, 88)
BAR: Colour = (88, 116, 158)
CHOSEN: Colour = (245, 178, 66)
HEAT: Colour = (255, 150, 0)
OUTCOMES: dict[str, Colour] = {"goal": (74, 214, 110), "collision": (255, 98, 88), "timeout": (245, 178, 66)}
DANGER = OUTCOMES["collision"]
# The colours of Okabe and Ito, brightened for the dark background.
SKY, ORANGE, GREEN = (86, 180, 233), (230, 159, 0), (0, 190, 140)
YELLOW, VERMILION, PURPLE = (240, 228, 66), (235, 110, 40), (215, 140, 185)
SERIES = (SKY, ORANGE, GREEN, PURPLE, YELLOW, VERMILION)
GOAL_MARK = SKY
# The two episodes of a comparison.
PAIR = (SKY, ORANGE)

# Charts: the colours of Okabe and Ito. Dashes tell lines apart without colour.
SCRATCH = "#000000"
CHART_SERIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
CHART_DASHES = ("-", "--", "-.", ":")
CHART_OUTCOMES = {"goal": ("#009E73", "o"), "collision": ("#D55E00", "x"), "timeout": ("#7A7A7A", "^")}
BEST_KNOWN, EPSILON = "#CC79A7", "#E69F00"
MUTED, OTHERS, SHIPS, GOAL = "#7A7A7A", "#D4D4D4", "#5A5A5A", "#B02020"
# Matplotlib's settings while a chart is drawn and saved: a grid behind the lines, no frame above and right
# of them, and no formulas, because names of files may contain a dollar sign.
CHART: dict[RcKeyType, Any] = {
    "figure.constrained_layout.use": True,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#E4E4E4",
    "legend.frameon": False,
    "text.parse_math": False,
}


def blend(colour: Colour, background: Colour, share: float) -> Colour:
    """Mix `share` of a colour into a background."""
    red, green, blue = (round(b + share * (c - b)) for c, b in zip(colour, background, strict=True))
    return red, green, blue


def arm_styles(names: list[str]) -> dict[str, dict[str, str]]:
    """Return colour and dashes of each arm: scratch is solid black, the others follow the palette."""
    others = [name for name in names if name != "scratch"]
    styles = {"scratch": {"color": SCRATCH, "linestyle": "-"}}
    for k, name in enumerate(others):
        colour = CHART_SERIES[k % len(CHART_SERIES)]
        # After 12 arms colours and dashes would repeat together, so the dashes shift by one.
        styles[name] = {"color": colour, "linestyle": CHART_DASHES[(k + k // 12) % len(CHART_DASHES)]}
    return styles


def number(value: float, form: str) -> str:
    """Format a number with a true minus sign, and without one before zero."""
    return format(value, f"z{form}").replace("-", "\N{MINUS SIGN}")


def counted(items: int, noun: str) -> str:
    """Write a count: "no seeds", "1 seed", "2 seeds"."""
    return f"{items or 'no'} {noun}{'' if items == 1 else 's'}"


def action_text(world: World, action: int) -> str:
    """Write the speed of an action, and its turn as an arrow with its size."""
    speed, turn = world.actions[action]
    if turn == 0:
        return f"{speed:g} m/s \N{UPWARDS ARROW}"
    port, starboard = "\N{ANTICLOCKWISE OPEN CIRCLE ARROW}", "\N{CLOCKWISE OPEN CIRCLE ARROW}"
    return f"{speed:g} m/s {port if turn > 0 else starboard} {abs(turn):g}"


def circle_names(world: World) -> tuple[str, str]:
    """Name the circle around the goal, and the one around own ship."""
    return f"expected distance {world.goal_distance:g} m", f"safe distance {world.safe_distance:g} m"


def add_legend(figure: Figure, axes: Iterable[Axes], place: str, columns: int, letters: float) -> None:
    """Add a legend of the lines in `axes` below all axes, each label once; `letters` in points."""
    found = (zip(*reversed(one.get_legend_handles_labels()), strict=True) for one in axes)
    entries = dict(chain.from_iterable(found))
    style: Style = {"loc": f"outside lower {place}", "ncols": columns, "fontsize": letters}
    figure.legend(list(entries.values()), list(entries), **style)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a PNG atomically."""
    with atomic_write(path) as draft:
        # Leave out the version of Matplotlib, so that the same figure gives the same bytes.
        figure.savefig(draft, format="png", metadata={"Software": None})
