"""The paper's claims, its conclusions, and our own questions, as contrasts (analysis-plan.md)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import yaml

from ship_trl.study.claims import Claims
from ship_trl.study.plan import (
    CONTROL_KINDS,
    FE,
    FT,
    NEW_CASE,
    OTHER_SOURCES,
    PERMUTED,
    RANDOM,
    REUSED,
    REUSED_CASE,
    SCRATCH,
    TRANSFERS,
)
from studies.paper.contrasts import (
    SELF_CASES,
    Spread,
    Test,
    beats,
    by_path,
    compare,
    control,
    each_beats,
    interaction,
    itself,
    means,
    network_effect,
    no_more,
    rises,
    self_dips,
)
from studies.paper.judge import CONCLUSION, EXPLORATORY, Claim
from studies.paper.report import report

FOLDER = Path(__file__).parent
# The pairs of figures 5 to 7, in their order.
FIGURES = {"high": "5", "low": "6", "lowest": "7"}
# The paper's numbers of table 2.
SIMILARITY = {"high": 0.83, "low": 0.45, "lowest": 0.42}


def claims() -> Claims:
    """Return what the paper's study was asked, for its report."""
    numbers = yaml.safe_load((FOLDER / "analysis.yaml").read_text())
    return Claims(
        judge=lambda study, folder: report(study, folder, ALL, OURS),
        pairs=tuple(FIGURES),
        page=FOLDER / "paper.html",
        rules=(FOLDER / "analysis-plan.md", FOLDER / "analysis.yaml"),
        margin=numbers["margin"],
        gains=numbers["gains"],
        titles={pair: f"Figure {figure}" for pair, figure in (*FIGURES.items(), (NEW_CASE, "9"))},
        similarity=SIMILARITY,
    )


def claim(name: str, sentence: str, tests: Sequence[Test]) -> Claim:
    """Make a claim; its name gives its figure: C1 is a conclusion, E1 explores, H5a is of figure 5."""
    return Claim(name, {"C": CONCLUSION, "E": EXPLORATORY}.get(name[0], name[1]), sentence, tests)


def transfers_but(*names: str) -> tuple[str, ...]:
    """Return all arms but scratch and those named."""
    return tuple(arm for arm in TRANSFERS if arm not in names)


NOT_DIPPING = transfers_but("FE2", "FT1")
NOT_WHOLE = (SCRATCH, *FE, *FT)
# Contrasts that conclusion C4 has too.
EXTRACTION_DIPS = [means("high", ("FE1", "FE3"), ("FE2",)), beats("high", SCRATCH, "FE2")]
FINETUNING_DIPS = [beats("high", SCRATCH, "FT1"), beats("high", "FT2", "FT1")]
SELF_DIPS = self_dips("self")
NO_DIPS = [no_more("low", ("FE1", "FE3"), ("FE2",)), no_more("low", ("FT2",), ("FT1",))]
HYPOTHESES = [
    claim(
        "H4a",
        "A source with the same path is worth more than one with the same ship: sooner and higher.",
        [by_path(arm, metric) for arm in ("FE3", "FTW") for metric in ("time", "area")],
    ),
    claim(
        "H5a",
        "Every arm but FE2 and FT1 beats scratch, and is sooner.",
        each_beats("high", NOT_DIPPING, [SCRATCH], "area", "time"),
    ),
    claim("H5b", "Those arms vary less across seeds.", [Spread("high", arm, SCRATCH) for arm in NOT_DIPPING]),
    claim("H5c", "FE2 dips below its neighbours and below scratch.", EXTRACTION_DIPS),
    claim("H5d", "FT1 is below scratch and below FT2.", FINETUNING_DIPS),
    claim("H5e", "Freezing cures it: FE1 above FT1.", [beats("high", "FE1", "FT1")]),
    claim("H5f", "FTW beats all other arms.", each_beats("high", ["FTW"], NOT_WHOLE, "area")),
    claim(
        "H5g",
        "Feature extraction is above finetuning of as many layers, and sooner.",
        [
            means("high", better, worse, metric)
            for metric in ("area", "time")
            for better, worse in ((FE, FT), (FE[2:], FT[2:]))
        ],
    ),
    claim(
        "H5h",
        "FT2 < FT3 < FT4 < FTW, and each is sooner than the last.",
        [
            beats("high", better, worse, metric)
            for metric in ("area", "time")
            for worse, better in pairwise(("FT2", "FT3", "FT4", "FTW"))
        ],
    ),
    claim(
        "H5i",
        "FE3 is above FE4, to the end, sooner and steadier.",
        [*each_beats("high", ["FE3"], ["FE4"], "area", "asymptote", "time"), Spread("high", "FE3", "FE4")],
    ),
    claim("H5j", "The dips are co-adaptation: a case to itself has them too.", SELF_DIPS),
    claim("H5k", "Finetuning cures the dip of two layers: FT2 above FE2.", [beats("high", "FT2", "FE2")]),
    claim(
        "H6a",
        "All arms but FE4 beat scratch, and are sooner.",
        each_beats("low", transfers_but("FE4"), [SCRATCH], "area", "time"),
    ),
    claim("H6b", "There are no dips: neither of FE2 nor of FT1.", NO_DIPS),
    claim(
        "H6c",
        "Finetuning is above feature extraction, and steadier.",
        [means("low", FT, FE), *(Spread("low", t, e) for t, e in zip(FT, FE, strict=True))],
    ),
    claim(
        "H6d", "FE4 is the worst arm.", each_beats("low", (SCRATCH, *transfers_but("FE4")), ["FE4"], "area")
    ),
    claim(
        "H6e",
        "FTW is best early, from its first greedy evaluation on, and collides less.",
        [
            *each_beats("low", ["FTW"], NOT_WHOLE, "early area", "start"),
            means("low", (*FE, *FT), ("FTW",), "early collisions"),
        ],
    ),
    claim(
        "H6f",
        "FT1 reaches the threshold first.",
        each_beats("low", ["FT1"], (SCRATCH, *transfers_but("FT1")), "time"),
    ),
    claim(
        "H7a",
        "Arms of one and two layers beat scratch.",
        each_beats("lowest", ("FE1", "FE2", "FT1", "FT2"), [SCRATCH], "area"),
    ),
    claim("H7b", "Finetuning ends above extraction.", [means("lowest", FT, FE, "asymptote")]),
    claim(
        "H7c",
        "The score falls as more layers are transferred.",
        [rises("lowest", *FE[::-1]), rises("lowest", *FT[::-1])],
    ),
    claim("H7d", "FE4 is below scratch.", [beats("lowest", SCRATCH, "FE4")]),
    claim(
        "H7e",
        "FT1 to FT4 fall when exploration ends, more than FTW does, and collide more.",
        each_beats("lowest", FT, ["FTW"], "dip", "collision rise"),
    ),
    claim(
        "H7f",
        "FTW falls no more than scratch, and ends lower than FT1 to FT4.",
        [no_more("lowest", ("FTW",), (SCRATCH,), "dip"), means("lowest", FT, ("FTW",), "asymptote")],
    ),
    claim(
        "H9a",
        "A reused network is sooner than a new one, also where both explore alike.",
        # The paper's comparison changes network and epsilon at once.
        [compare(NEW_CASE, REUSED, ["reused, low"], ["scratch, 1"], "time"), network_effect("time")],
    ),
    claim(
        "H9b",
        "Case 2 is the best source, each case's network trained on it alone.",
        [compare(NEW_CASE, REUSED, [f"case {REUSED_CASE}"], [f"case {case}"]) for case in OTHER_SOURCES],
    ),
]
CONCLUSIONS = [
    claim(
        "C1",
        "There are features: FE3 beats scratch, and frozen layers that have learned nothing.",
        [beats("high", "FE3", SCRATCH), *(control("high", "FE3", kind) for kind in CONTROL_KINDS)],
    ),
    claim(
        "C2",
        "More layers help in pair high and harm in the others; "
        "extraction beats finetuning in pair high, and loses in the others.",
        [
            *(rises("high", *arms) for arms in (FE, FT)),
            *(rises(pair, *arms[::-1]) for pair in ("low", "lowest") for arms in (FE, FT)),
            means("high", FE, FT),
            *(means(pair, FT, FE) for pair in ("low", "lowest")),
        ],
    ),
    claim(
        "C3",
        "FE3 is sooner than FE4, and ends higher, in all pairs.",
        [beats(pair, "FE3", "FE4", metric) for pair in FIGURES for metric in ("time", "asymptote")],
    ),
    claim(
        "C4",
        "Torn co-adaptation makes dips: in pair high and from a case to itself, and none in low.",
        [*EXTRACTION_DIPS, *FINETUNING_DIPS, *SELF_DIPS, *NO_DIPS],
    ),
    claim(
        "C5",
        "Finetuning everything is better early than finetuning the conv layers, and ends lower.",
        [
            *(beats(pair, "FTW", "FT4", "early area") for pair in FIGURES),
            *(beats(pair, "FT4", "FTW", "asymptote") for pair in FIGURES),
        ],
    ),
]
# Each is judged alone; they explain, and decide no claim.
OURS = [
    claim(
        "E1",
        "Frozen layers that have learned beat random ones, for each number of layers and pair.",
        [control(pair, arm, RANDOM) for pair in FIGURES for arm in FE],
    ),
    claim(
        "E2",
        "They beat the same weights permuted within each layer.",
        [control(pair, arm, PERMUTED) for pair in FIGURES for arm in FE],
    ),
    claim("E3", "Cases 4 and 6 to themselves dip too.", [*self_dips("self4"), *self_dips("self6")]),
    claim(
        "E4",
        "A case's own network, finetuned as a whole, beats learning it from scratch.",
        [itself(label, "FTW", SCRATCH) for label in SELF_CASES],
    ),
    claim(
        "E5",
        "A reused network gains more where exploration starts low, in time and in area; it is higher too.",
        [interaction("time"), interaction("area"), network_effect("area")],
    ),
    claim(
        "E6",
        "FTW misses the goal less often than scratch once exploration is over.",
        [beats(pair, SCRATCH, "FTW", "misses") for pair in FIGURES],
    ),
]
ALL = [*CONCLUSIONS, *HYPOTHESES]
