"""Colours and line styles of pictures on a dark background and of charts on white.

The colours and shapes of ships are in `ship_trl.sim.scene`, because the network sees them too.
"""

from __future__ import annotations

Colour = tuple[int, int, int]

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
GRID, MUTED, OTHERS, SHIPS, GOAL = "#E4E4E4", "#7A7A7A", "#D4D4D4", "#5A5A5A", "#B02020"


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
