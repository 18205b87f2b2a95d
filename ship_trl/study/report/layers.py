"""How alike the layers of networks are, by pair: what transfer keeps, beside what two trainings share."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ship_trl.study.analysis.study import Study
from ship_trl.study.records.layers import OTHER_SEED, SCRATCH, SOURCE, UNTRAINED, Layer
from ship_trl.study.report import figures, tables
from ship_trl.study.report.figures import FONT, GREY, LOOKS, Form, Look, draw_curves, legend_above, plain
from ship_trl.study.report.panels import pairs, title

# Arm and what it stands beside, with the words for it. Black is scratch, as everywhere.
COMPARED = {
    ("FTW", SOURCE): ("FTW and its source", LOOKS[0]),
    (SCRATCH, OTHER_SEED): ("scratch and another seed", figures.SCRATCH),
    (SCRATCH, SOURCE): ("scratch and the source", LOOKS[1]),
    (SCRATCH, UNTRAINED): ("scratch and drawn weights", Look(GREY, (0, (1, 1)))),
}


def by_seed(rows: list[Layer], layers: list[str]) -> np.ndarray:
    """Return CKA by seed and layer [S, L], of the seeds that have all layers."""
    found: dict[int, dict[str, float]] = {}
    for row in rows:
        found.setdefault(row.seed, {})[row.layer] = row.cka
    whole = [
        [numbers[layer] for layer in layers]
        for _, numbers in sorted(found.items())
        if set(layers) <= set(numbers)
    ]
    kept = np.array(whole, dtype=np.float64).reshape(-1, len(layers))
    return kept[np.isfinite(kept).all(axis=1)]


def layer_rows(study: Study) -> list[tables.Row]:
    """Make a row for each layer of each two networks: interquartile mean of CKA over seeds, and interval."""
    found: dict[tuple[str, str, str, str], list[float]] = {}
    for row in study.layers:
        found.setdefault((row.pair, row.arm, row.beside, row.layer), []).append(row.cka)
    return [
        {
            **dict(zip(("pair", "arm", "beside", "layer"), names, strict=True)),
            "seeds": len(values),
            **tables.columns("cka", tables.estimate(values)),
        }
        for names, values in sorted(found.items())
    ]


def draw_layers(study: Study, form: Form) -> Figure | None:
    """Draw a panel for each pair; None where nothing of its layers is known."""
    known = [pair for pair in pairs(study) if any(row.pair == pair for row in study.layers)]
    if not known:
        return None
    layers = list(dict.fromkeys(row.layer for row in study.layers))
    across = 1 if form.narrow else max(3, len(known))
    down = -(-len(known) // across)
    figure = Figure(figsize=(form.width, 2.5 * down), dpi=form.dpi, layout="constrained")
    for k, pair in enumerate(known):
        axis = figure.add_subplot(down, across, k + 1)
        told, least = [], 0.0
        for (arm, beside), (words, look) in COMPARED.items():
            rows = [row for row in study.layers if (row.pair, row.arm, row.beside) == (pair, arm, beside)]
            curves = by_seed(rows, layers)
            if len(curves):
                low, _ = draw_curves(axis, np.arange(len(layers)), curves, look)
                least = min(least, low)
                told.append((f"{words} ({len(curves)})", look))
        plain(axis)
        legend_above(axis, told)
        axis.set_xticks(range(len(layers)), layers)
        axis.set_xlabel(title(study, pair).partition(": ")[2], fontsize=FONT, labelpad=2)
        axis.set_ylim(least - 0.05, 1.05)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
        if k % across == 0:
            axis.set_ylabel("CKA", fontsize=FONT, labelpad=2)
    return figure
