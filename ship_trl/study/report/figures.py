"""The figures of a report: their order, titles and captions, and how they are written."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from ship_trl.study.analysis.metrics import THRESHOLDS
from ship_trl.study.analysis.study import Study, pairs
from ship_trl.study.report.curves import draw_differences, draw_pair, draw_reuse, draw_times
from ship_trl.study.report.gains import TITLES, draw_gains
from ship_trl.study.report.layers import draw_layers
from ship_trl.study.report.panels import EPSILON, REUSE_TITLE, pair_title
from ship_trl.study.report.style import NARROW, WIDE, as_png, save

# Names of figures; files of an earlier report with such a name are removed if they are not drawn anew.
NAMES = ("pair_*", "reuse", "differences", "times", "gains", "gains_greedy", "layers", "forest_*")
BANDS = (
    "A line is the interquartile mean over seeds, moving over a twentieth of the episodes. Its band "
    "holds 95 % of the means of resampled seeds, at each place by itself; it decides nothing. Fewer "
    "than 4 seeds are a thin line each. In brackets: the number of runs."
)
CURVES = (
    f"Returns along the training; scratch is black. {BANDS} Grey at the bottom is the exploration rate, "
    "and the upright line is where it ends. Shaded at the left are episodes in which no run has learned "
    "yet."
)
REUSED = (
    f"{CURVES} {EPSILON} is the exploration rate at the start: 0.1 where none is named, and the same for "
    "scratch. A source was trained on its case alone, the reused network on case 1 and then on case 2."
)
DIFFERENCES = (
    "What an arm has more than scratch of the same seed, in scores: 0 is random actions, 1 the best "
    f"known return. {BANDS}"
)
TIMES = (
    f"The share of an arm's runs whose moving score has reached {THRESHOLDS[0]:g}, and how many of how "
    "many ever do. A run that never does keeps the line below 1. Scratch is black."
)
GAINS = "How much more area under the training curve than scratch, by arm and by source and target case."
GREEDY_GAINS = (
    "The same of greedy evaluations, which do not explore, on the same colour scale: the map above has "
    "what was earned during training, this one what the network knew. It decides nothing."
)
LAYERS = (
    "CKA of a layer of two networks on the same states of the target case: 1 is alike but for rotation "
    "and scaling, 0 unrelated. Another seed is the one before, if its networks still existed. "
    "Interquartile mean over seeds with a band as above; it decides nothing. In brackets: the number of "
    "seeds."
)


@dataclass(frozen=True)
class Drawing:
    """A figure that a report may have; `draw` takes a width in inches."""

    name: str
    title: str
    caption: str
    draw: Callable[[float], Figure | None]


@dataclass(frozen=True)
class Picture:
    """A drawn figure with its PNGs for wide and narrow screens, in base64."""

    title: str
    caption: str
    wide: str
    narrow: str


def drawings(study: Study) -> Iterator[Drawing]:
    """Yield the figures of a study, in the order of the page."""
    for pair in pairs(study):
        yield Drawing(f"pair_{pair}", pair_title(study, pair), CURVES, partial(draw_pair, study, pair))
    area, greedy = (partial(draw_gains, study, metric) for metric in TITLES)
    yield Drawing("reuse", REUSE_TITLE, REUSED, partial(draw_reuse, study))
    title = "Differences from scratch along the training"
    yield Drawing("differences", title, DIFFERENCES, partial(draw_differences, study))
    yield Drawing("times", "Time to the threshold", TIMES, partial(draw_times, study))
    yield Drawing("gains", "Gains of transfer, by source and target", GAINS, area)
    yield Drawing("gains_greedy", "Gains of transfer in greedy returns", GREEDY_GAINS, greedy)
    yield Drawing("layers", "Similarity of layers", LAYERS, partial(draw_layers, study))


def draw_all(study: Study, output: Path) -> list[Picture]:
    """Draw all figures that the study has runs for, as PNG and PDF, and remove those of an earlier report."""
    drawn, written = [], set()
    for drawing in drawings(study):
        wide, narrow = (drawing.draw(width) for width in (WIDE, NARROW))
        if wide is None or narrow is None:
            continue
        paths = save(wide, output / drawing.name)
        written |= set(paths)
        forms = (base64.b64encode(data).decode() for data in (paths[0].read_bytes(), as_png(narrow)))
        drawn.append(Picture(drawing.title, drawing.caption, *forms))
    for name in NAMES:
        for ending in ("png", "pdf"):
            for path in output.glob(f"{name}.{ending}"):
                if path not in written:
                    path.unlink()
    return drawn
