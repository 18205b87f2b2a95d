"""The paper's five conclusions, and our own exploratory contrasts."""

from __future__ import annotations

from ship_trl.study.claims.hypotheses import EXTRACTION_DIPS, FINETUNING_DIPS, NO_DIPS, SELF_DIPS
from ship_trl.study.claims.kinds import (
    Hypothesis,
    beats,
    control,
    interaction,
    itself,
    means,
    network_effect,
    rises,
    self_dips,
)
from ship_trl.study.plan.arms import CONTROL_KINDS, FE, FT, PERMUTED, RANDOM, SCRATCH

FIGURE, EXPLORATORY = "conclusions", "exploratory"
# By pair: its target, and the label of that case's transfer to itself.
ITSELF = {"high": ("2", "self"), "low": ("4", "self4"), "lowest": ("6", "self6")}
CONCLUSIONS = [
    Hypothesis(
        "C1",
        FIGURE,
        "There are features: FE3 beats scratch, and frozen layers that have learned nothing.",
        [beats("high", "FE3", SCRATCH), *(control("high", "FE3", kind) for kind in CONTROL_KINDS)],
    ),
    Hypothesis(
        "C2",
        FIGURE,
        "More layers help in pair high and harm in the others; "
        "extraction beats finetuning in pair high, and loses in the others.",
        [
            *(rises("high", *arms) for arms in (FE, FT)),
            *(rises(pair, *arms[::-1]) for pair in ("low", "lowest") for arms in (FE, FT)),
            means("high", FE, FT),
            *(means(pair, FT, FE) for pair in ("low", "lowest")),
        ],
    ),
    Hypothesis(
        "C3",
        FIGURE,
        "FE3 is sooner than FE4, and ends higher, in all pairs.",
        [beats(pair, "FE3", "FE4", metric) for pair in ITSELF for metric in ("time", "asymptote")],
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
        "Finetuning everything is better early than finetuning the conv layers, and ends lower.",
        [
            *(beats(pair, "FTW", "FT4", "early area") for pair in ITSELF),
            *(beats(pair, "FT4", "FTW", "asymptote") for pair in ITSELF),
        ],
    ),
]
# Each is judged alone; they explain, and decide no claim.
OURS = [
    Hypothesis(
        "E1",
        EXPLORATORY,
        "Frozen layers that have learned beat random ones, for each number of layers and pair.",
        [control(pair, arm, RANDOM) for pair in ITSELF for arm in FE],
    ),
    Hypothesis(
        "E2",
        EXPLORATORY,
        "They beat the same weights permuted within each layer.",
        [control(pair, arm, PERMUTED) for pair in ITSELF for arm in FE],
    ),
    Hypothesis(
        "E3",
        EXPLORATORY,
        "Cases 4 and 6 to themselves dip too.",
        [*self_dips("4", "low", "self4"), *self_dips("6", "lowest", "self6")],
    ),
    Hypothesis(
        "E4",
        EXPLORATORY,
        "A case's own network, finetuned as a whole, beats learning it from scratch.",
        [itself(case, pair, label, "FTW", SCRATCH) for pair, (case, label) in ITSELF.items()],
    ),
    Hypothesis(
        "E5",
        EXPLORATORY,
        "A reused network gains more where exploration starts low, in time and in area; it is higher too.",
        [interaction("time"), interaction("area"), network_effect("area")],
    ),
    Hypothesis(
        "E6",
        EXPLORATORY,
        "FTW misses the goal less often than scratch once exploration is over.",
        [beats(pair, SCRATCH, "FTW", "misses") for pair in ITSELF],
    ),
]
