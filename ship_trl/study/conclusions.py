"""The paper's five conclusions, as contrasts; each claimed per pair, not for similarity as such."""

from __future__ import annotations

from ship_trl.study.claims import FE, FT, Hypothesis, beats, frozen_random, interaction, steeper, trend
from ship_trl.study.hypotheses import EXTRACTION_DIPS, FINETUNING_DIPS, NO_DIPS, SELF_DIPS

FIGURE = "conclusions"
PAIRS_OF_THE_PAPER = ("high", "low", "lowest")
CONCLUSIONS = [
    Hypothesis(
        "C1",
        FIGURE,
        "There are features: FE3 beats scratch, and frozen layers that have learned nothing.",
        [beats("high", "FE3", "scratch"), frozen_random("high")],
    ),
    Hypothesis(
        "C2",
        FIGURE,
        "More layers help in pair high and harm in the others; so does extraction beside finetuning.",
        [
            *(trend("high", *arms) for arms in (FE, FT)),
            *(trend(pair, *arms[::-1]) for pair in ("low", "lowest") for arms in (FE, FT)),
            *(steeper("high", pair, arms) for pair in ("low", "lowest") for arms in (FE, FT)),
            *(interaction("high", pair, FE, FT) for pair in ("low", "lowest")),
        ],
    ),
    Hypothesis(
        "C3",
        FIGURE,
        "FE3 beats FE4 in all pairs.",
        [beats(pair, "FE3", "FE4") for pair in PAIRS_OF_THE_PAPER],
    ),
    Hypothesis(
        "C4",
        FIGURE,
        "Torn co-adaptation makes dips: in pair high and from a case to itself, and none in low.",
        [*EXTRACTION_DIPS, *FINETUNING_DIPS, *SELF_DIPS, *NO_DIPS],
    ),
    Hypothesis(
        "C5",
        FIGURE,
        "Finetuning everything is best early and gains least late.",
        [
            *(beats(pair, "FTW", "FT4", "early area") for pair in PAIRS_OF_THE_PAPER),
            *(beats(pair, "FT4", "FTW", "late gain") for pair in PAIRS_OF_THE_PAPER),
        ],
    ),
]
