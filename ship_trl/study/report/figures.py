"""The figures of a report: order, titles and files; page.html has their captions."""

from __future__ import annotations

import base64
from collections.abc import Callable
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from ship_trl.study.report.curves import draw_differences, draw_pair, draw_reuse, draw_times
from ship_trl.study.report.forest import draw_forest
from ship_trl.study.report.gains import draw_gains
from ship_trl.study.report.layers import draw_layers
from ship_trl.study.report.panels import pair_title, reuse_title
from ship_trl.study.report.style import NARROW, WIDE, as_png, save
from ship_trl.study.study import Study, pairs

# Names of figures. Files of an earlier report with these names are removed unless they are drawn again.
NAMES = (
    *("pair_*", "reuse", "differences", "times", "gains", "gains_greedy", "gains_forest", "layers"),
    "forest_*",
)
# Draws a figure of a width in inches; None if the study has no runs for it.
Draw = Callable[[float], Figure | None]


def drawings(study: Study) -> dict[str, tuple[str, Draw]]:
    """Return title and drawing function of each figure by its name, in the order of the page."""
    return {
        **{
            f"pair_{pair}": (pair_title(study, pair), partial(draw_pair, study, pair))
            for pair in pairs(study)
        },
        "reuse": (reuse_title(study), partial(draw_reuse, study)),
        "differences": ("Differences from scratch along the training", partial(draw_differences, study)),
        "times": ("Time to the threshold", partial(draw_times, study)),
        "gains": ("Gains of transfer, by source and target", partial(draw_gains, study, "area")),
        "gains_greedy": ("Gains of transfer in greedy returns", partial(draw_gains, study, "greedy area")),
        "gains_forest": ("Gains of the pairs in greedy returns", partial(draw_forest, study)),
        "layers": ("Similarity of layers", partial(draw_layers, study)),
    }


def draw_all(study: Study, output: Path, show: Callable[[float], None]) -> list[dict[str, str]]:
    """Draw all figures that the study has runs for, as PNG and PDF, and remove those of an earlier report.

    `show` is told the share of the figures that are done.

    Returns:
        For each figure its name, its title, and its PNGs for wide and narrow screens in base64.
    """
    pictures, written = [], set()
    planned = drawings(study)
    for done, (name, (title, draw)) in enumerate(planned.items()):
        show(done / len(planned))
        wide, narrow = draw(WIDE), draw(NARROW)
        if wide is None or narrow is None:
            continue
        paths = save(wide, output / name)
        written |= set(paths)
        forms = {"wide": paths[0].read_bytes(), "narrow": as_png(narrow)}
        encoded = {form: base64.b64encode(data).decode() for form, data in forms.items()}
        pictures.append({"name": name, "title": title} | encoded)
    for path in (path for name in NAMES for path in output.glob(f"{name}.*")):
        if path.suffix in (".png", ".pdf") and path not in written:
            path.unlink()
    return pictures
