"""Table 2: how similar source and target of each pair are, with the rules that gave each number."""

from __future__ import annotations

from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.plan.config import names, read
from ship_trl.study.report.tables import Row
from ship_trl.transfer.similarity import ALPHA, BETA, in_words, similarity

# The paper's numbers, table 2.
PRINTED = {"high": 0.83, "low": 0.45, "lowest": 0.42}
EQUATION = f"{ALPHA:g} common / ({ALPHA:g} common + {BETA:g} different)"


def table_2() -> list[Row]:
    """Make a row for each pair of conf/pair, the most similar first."""
    world, rows = load_world(), []
    for pair in names("pair"):
        values = read("pair", pair)
        base, target = (load_case(str(values[key]), world) for key in ("source", "target"))
        common, different = in_words(base, target)
        rows.append(
            {
                "pair": pair,
                "source": base.name,
                "target": target.name,
                "similarity": similarity(base, target),
                "paper": PRINTED.get(pair, ""),
                "common": common,
                "different": different,
            }
        )
    return sorted(rows, key=lambda row: -row["similarity"])
