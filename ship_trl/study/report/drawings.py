"""Which figures a report has: what each is called, what it shows, and its two forms."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from ship_trl.study.analysis.metrics import THRESHOLDS
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.conclusions import EXPLORATORY
from ship_trl.study.claims.conclusions import FIGURE as CONCLUSIONS
from ship_trl.study.claims.verdicts import Answer
from ship_trl.study.report.curves import draw_pair, draw_reuse
from ship_trl.study.report.differences import draw_differences
from ship_trl.study.report.ecdf import draw_times
from ship_trl.study.report.figures import PAGE, TELEPHONE, Form, as_png, save
from ship_trl.study.report.forest import draw_forest
from ship_trl.study.report.heat_map import draw_gains, draw_greedy_gains
from ship_trl.study.report.layers import draw_layers
from ship_trl.study.report.panels import REUSE, pairs, title

# Families of claims that are no figure of the paper.
ABOUT = {CONCLUSIONS: "Conclusions", EXPLORATORY: "What explains them"}
# Files of an earlier report, which go if they are not drawn anew.
OWN = ("pair_*", "reuse", "differences", "times", "gains", "gains_greedy", "layers", "forest_*")
BANDS = (
    "Interquartile mean over seeds, moving over a twentieth of the episodes; the band holds 95 % of the "
    "means of resampled seeds, at each place by itself. It describes, and decides nothing. Fewer than 4 "
    "seeds are a thin line each. In brackets the number of runs."
)
CURVES = (
    f"{BANDS} Black is scratch. The grey strip is the exploration rate; the upright line is where it ends. "
    "Shaded at the left are episodes in which no run has learned yet."
)
REUSED = (
    f"{CURVES} \N{GREEK SMALL LETTER EPSILON} is the exploration rate that a run begins with, 0.1 where none "
    "is named; scratch begins with the same. A source was trained on its case alone, the reused network on "
    "case 1 and then on case 2."
)
DIFFERENCES = (
    "What an arm has more than scratch with the same seed, in scores: 0 is random actions, 1 the best known. "
    f"{BANDS}"
)
TIMES = (
    f"The share of an arm's runs whose moving score has been at {THRESHOLDS[0]:g}, and how many of how many "
    "ever are. A run that never is ends the line below 1. Black is scratch."
)
GAINS = (
    "Interquartile mean of the difference of the area under the training-return curve, in scores, from "
    "scratch on the target, and its 95 % interval; bold where that does not hold zero. In brackets how many "
    "seeds a cell has, where others have more; an interval of so few may be much too narrow or too wide."
)
GREEDY_GAINS = (
    "The same of greedy evaluations, which do not explore: the picture above is of what was earned on the "
    "way, with random actions in it, this one of what the network knew. It describes, and decides nothing."
)
LAYERS = (
    "CKA of a layer of two networks on the same states of the target case: 1 is alike but for turning and "
    "scaling, 0 unrelated. Another seed is the one before it, if its networks were still there. "
    "Interquartile mean over seeds with a band as above; it explains, and decides nothing. In brackets the "
    "number of seeds."
)
FOREST = (
    "Estimate and interval at the level of the look; positive is as claimed. Grey is the margin within which "
    "a difference counts as none. A row is called supported or equivalent by itself, and contradicted only "
    "as adjusted over all contrasts of the figure, so that some rows below zero are inconclusive. The bold "
    "words are the verdict on the claim. An arrow is an interval that goes on."
)


@dataclass(frozen=True)
class Drawing:
    """A figure that a report may have; `folded` ones are opened on the page."""

    name: str
    title: str
    caption: str
    draw: Callable[[Form], Figure | None]
    folded: bool = False


@dataclass(frozen=True)
class Drawn:
    """A figure: its title, what it shows, its PNG for a page, and that for a telephone."""

    title: str
    caption: str
    wide: bytes
    narrow: bytes
    folded: bool


def drawings(study: Study, answers: Sequence[Answer]) -> Iterator[Drawing]:
    """Yield the figures of a study, in the order of the page."""
    for pair in pairs(study):
        yield Drawing(f"pair_{pair}", title(study, pair), CURVES, partial(draw_pair, study, pair))
    for name, heading, caption, draw in (
        ("reuse", REUSE, REUSED, draw_reuse),
        ("differences", "Differences from scratch along the training", DIFFERENCES, draw_differences),
        ("times", "Time to the threshold", TIMES, draw_times),
        ("gains", "What transfer gains, by source and target", GAINS, draw_gains),
        ("gains_greedy", "What transfer gains in greedy returns", GREEDY_GAINS, draw_greedy_gains),
        ("layers", "How alike layers are", LAYERS, draw_layers),
    ):
        yield Drawing(name, heading, caption, partial(draw, study))
    for figure in dict.fromkeys(answer.hypothesis.figure for answer in answers):
        family = [answer for answer in answers if answer.hypothesis.figure == figure]
        about = ABOUT.get(figure, f"Figure {figure}")
        yield Drawing(f"forest_{figure}", about, FOREST, partial(draw_forest, family), folded=True)


def draw_all(study: Study, answers: Sequence[Answer], output: Path) -> list[Drawn]:
    """Draw all figures that the study has runs for: PNG and PDF; those of an earlier report are removed."""
    drawn, written = [], set()
    for drawing in drawings(study, answers):
        wide = drawing.draw(PAGE)
        narrow = drawing.draw(TELEPHONE)
        if wide is None or narrow is None:
            continue
        paths = save(wide, output / drawing.name)
        written |= set(paths)
        drawn.append(
            Drawn(drawing.title, drawing.caption, paths[0].read_bytes(), as_png(narrow), drawing.folded)
        )
    for name in OWN:
        for ending in ("png", "pdf"):
            for path in output.glob(f"{name}.{ending}"):
                if path not in written:
                    path.unlink()
    return drawn
