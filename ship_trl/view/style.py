"""The look of pictures (dark) and of charts (white): colours, dashes, words and numbers, axes and legends.

The colours and shapes of ships are in `ship_trl.sim.scene`, because the network sees them too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import RcKeyType

from ship_trl.config.arm import Arm
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
# The two episodes of a comparison that names no two arms.
PAIR = (SKY, ORANGE)

# Charts: the colours of Okabe and Ito. Dashes tell lines apart without colour.
BLACK = "#000000"
CHART_SERIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
CHART_DASHES = ("-", "--", "-.", ":")
AMBER, LIGHT_BLUE = CHART_SERIES[4:]
BROWN, GREY = "#7F5539", "#6B7280"
DASHED, DOTTED, DASH_DOTTED = (0, (4, 1.5)), (0, (1, 1)), (0, (4, 1, 1, 1))
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


def line(colour: str, dashes: Any = "-") -> Style:
    """Return the look of a line in a chart."""
    return {"color": colour, "linestyle": dashes}


# The look of every arm in all charts, pages and films: by its name, else by its ending (all controls of one
# kind look alike), else by the letters that it begins with.
ARMS = {
    "scratch": line(BLACK),
    **{f"FE{k}": line(colour) for k, colour in enumerate(CHART_SERIES[:4], 1)},
    **{f"FT{k}": line(colour, DASHED) for k, colour in enumerate(CHART_SERIES[:4], 1)},
    "FTW": line(AMBER, DASH_DOTTED),
}
CONTROLS = {"-random": line(LIGHT_BLUE, DOTTED), "-permuted": line(BROWN, DASH_DOTTED)}
OTHER_ARMS = dict(
    zip(("FE", "FT", "GU", "SP", "G", "QD", "QR"), (LIGHT_BLUE, BROWN, *CHART_SERIES), strict=False)
)
# The colours of charts as they are on the dark background of a film.
ON_DARK = {
    BLACK: TEXT,
    **dict(zip(CHART_SERIES, ((90, 155, 235), VERMILION, GREEN, PURPLE, ORANGE, SKY), strict=True)),
    BROWN: (196, 150, 112),
}


def look_of(arm: str) -> Style:
    """Return colour and dashes of an arm; what is no arm is grey."""
    endings = (look for ending, look in CONTROLS.items() if arm.endswith(ending))
    colours = (colour for prefix, colour in OTHER_ARMS.items() if arm.startswith(prefix))
    return ARMS.get(arm) or next(endings, None) or line(next(colours, GREY), DOTTED)


def arm_in(title: str) -> str | None:
    """Return the arm that a title such as "high FT3 seed 0, best" names, or None."""
    for word in title.replace(",", " ").split():
        with suppress(ValueError):
            return Arm.parse(word).name
    return None


def arm_styles(names: Sequence[str]) -> dict[str, Style]:
    """Return colour and dashes of lines by their names, in which each arm has its look.

    Where two would look alike, as runs of an arm with other settings, the later one has other dashes. Names
    without an arm take the colours of the palette in turn.
    """
    styles: dict[str, Style] = {}
    for k, name in enumerate(names):
        arm = arm_in(name)
        look = line(CHART_SERIES[k % len(CHART_SERIES)]) if arm is None else look_of(arm)
        dashes = [look["linestyle"], *CHART_DASHES]
        free = (one for one in dashes if line(look["color"], one) not in styles.values())
        styles[name] = line(look["color"], next(free, look["linestyle"]))
    return styles


def pair_colours(titles: Sequence[str]) -> tuple[Colour, ...]:
    """Return the colours of the episodes of a comparison: those of their arms, if they differ."""
    arms = enumerate(map(arm_in, titles))
    colours = tuple(PAIR[k] if arm is None else ON_DARK.get(look_of(arm)["color"], FAINT) for k, arm in arms)
    return colours if len(set(colours)) == len(colours) else PAIR


def number(value: float, form: str) -> str:
    """Format a number with a true minus sign, and without one before zero."""
    return format(value, f"z{form}").replace("-", "\N{MINUS SIGN}")


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
