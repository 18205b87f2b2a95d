"""Similarity of layers by pair: what transfer keeps, compared with what two trainings share."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ship_trl.study.plan import WHOLE
from ship_trl.study.report.panels import cases_of
from ship_trl.study.report.style import (
    DASHED,
    DOTTED,
    DPI,
    FONT,
    NARROW,
    Look,
    draw_curves,
    legend_above,
    look_of,
    style_axis,
)
from ship_trl.study.study import Study, pairs
from ship_trl.study.tables import OTHER_SEED, SCRATCH, SOURCE, UNTRAINED, Layer

# Words and look of each arm and the network that it is compared with; lines of scratch are black.
COMPARED = {
    (WHOLE, SOURCE): ("FTW and its source", look_of(WHOLE)),
    (SCRATCH, OTHER_SEED): ("scratch and another seed", look_of(SCRATCH)),
    (SCRATCH, SOURCE): ("scratch and the source", Look(look_of(SCRATCH).colour, DASHED)),
    (SCRATCH, UNTRAINED): ("scratch and random weights", Look(look_of(SCRATCH).colour, DOTTED)),
}


def by_seed(rows: list[Layer], layers: list[str]) -> np.ndarray:
    """Return CKA by seed and layer [S, L], for the seeds that have all layers."""
    import pandas as pd

    table = pd.DataFrame(rows, columns=Layer._fields).pivot(index="seed", columns="layer", values="cka")
    return table.reindex(columns=layers).dropna().to_numpy()


def draw_layers(study: Study, width: float) -> Figure | None:
    """Draw a panel for each pair; None where no layers were measured."""
    known = [pair for pair in pairs(study) if any(row.pair == pair for row in study.layers)]
    if not known:
        return None
    layers = list(dict.fromkeys(row.layer for row in study.layers))
    columns = 1 if width == NARROW else max(3, len(known))
    rows = -(-len(known) // columns)
    figure = Figure(figsize=(width, 2.5 * rows), dpi=DPI[width], layout="constrained")
    for k, pair in enumerate(known):
        axis = figure.add_subplot(rows, columns, k + 1)
        names, least = [], 0.0
        for compared, (words, look) in COMPARED.items():
            found = [row for row in study.layers if (row.pair, row.arm, row.beside) == (pair, *compared)]
            curves = by_seed(found, layers)
            if len(curves):
                low, _ = draw_curves(axis, np.arange(len(layers)), curves, look)
                least = min(least, low)
                names.append((f"{words} ({len(curves)})", look))
        style_axis(axis)
        legend_above(axis, names)
        axis.set_xticks(range(len(layers)), layers)
        axis.set_xlabel(f"pair {pair}, {cases_of(study, pair)}", fontsize=FONT, labelpad=2)
        axis.set_ylim(least - 0.05, 1.05)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
        if k % columns == 0:
            axis.set_ylabel("CKA", fontsize=FONT, labelpad=2)
    return figure
