"""The paper's claims of figures 5 to 7 and 9 as contrasts that are measured.

A claim has a name (H5a ...), a sentence, and the contrasts that it stands on; positive is as claimed.
"""

from __future__ import annotations

from ship_trl.study.claims import (
    FE,
    FT,
    SELF,
    TRANSFERS,
    Hypothesis,
    at,
    beats,
    best_source,
    confounded,
    early,
    either,
    like_neighbours,
    means,
    network_effect,
    no_more,
    positive,
    steady,
    trend,
)
from ship_trl.study.plan import OTHER_SOURCES

NOT_DIPPING = tuple(arm for arm in TRANSFERS if arm not in ("FE2", "FT1"))
# Parts of conclusion C4 too.
EXTRACTION_DIPS = [means("high", ("FE1", "FE3"), ("FE2",)), beats("high", "scratch", "FE2")]
FINETUNING_DIPS = [beats("high", "scratch", "FT1"), beats("high", "FT2", "FT1")]
SELF_DIPS = [
    *(at("2 to 2", SELF, better, "FE2") for better in ("scratch", "FE1", "FE3")),
    *(at("2 to 2", SELF, better, "FT1") for better in ("scratch", "FT2")),
]
NO_DIPS = [
    like_neighbours("low", "FT1", ("FT2",)),
    *(
        like_neighbours("low", f"{kind}{n}", (f"{kind}{n - 1}", f"{kind}{n + 1}"))
        for kind in ("FE", "FT")
        for n in (2, 3)
    ),
]
HYPOTHESES = [
    Hypothesis(
        "H5a",
        "5",
        "Every arm but FE2 and FT1 beats scratch.",
        [beats("high", arm, "scratch") for arm in NOT_DIPPING]
        + [early("high", arm, "scratch") for arm in NOT_DIPPING],
    ),
    Hypothesis(
        "H5b",
        "5",
        "Those arms vary less across seeds.",
        [steady("high", arm, "scratch") for arm in NOT_DIPPING],
    ),
    Hypothesis("H5c", "5", "FE2 dips below its neighbours and below scratch.", EXTRACTION_DIPS),
    Hypothesis("H5d", "5", "FT1 is below scratch and below FT2.", FINETUNING_DIPS),
    Hypothesis("H5e", "5", "Freezing cures it: FE1 above FT1.", [beats("high", "FE1", "FT1")]),
    Hypothesis(
        "H5f",
        "5",
        "FTW beats all other arms.",
        [beats("high", "FTW", arm) for arm in ("scratch", *FE, *FT)],
    ),
    Hypothesis(
        "H5g",
        "5",
        "Feature extraction is above finetuning of as many layers.",
        [means("high", FE, FT), means("high", FE[2:], FT[2:])],
    ),
    Hypothesis("H5h", "5", "FT2 < FT3 < FT4 < FTW.", [trend("high", "FT2", "FT3", "FT4", "FTW")]),
    Hypothesis(
        "H5i",
        "5",
        "FE3 is above FE4, sooner and steadier.",
        [beats("high", "FE3", "FE4"), early("high", "FE3", "FE4"), steady("high", "FE3", "FE4")],
    ),
    Hypothesis("H5j", "5", "The dips are co-adaptation: a case to itself has them too.", SELF_DIPS),
    Hypothesis(
        "H6a",
        "6",
        "All arms but FE4 beat scratch.",
        [beats("low", arm, "scratch") for arm in TRANSFERS if arm != "FE4"],
    ),
    Hypothesis("H6b", "6", "There are no dips.", NO_DIPS),
    Hypothesis(
        "H6c",
        "6",
        "Finetuning is above feature extraction, and steadier.",
        [means("low", FT, FE), *(steady("low", t, e) for t, e in zip(FT, FE, strict=True))],
    ),
    Hypothesis(
        "H6d",
        "6",
        "FE4 is the worst arm.",
        [beats("low", arm, "FE4") for arm in ("scratch", *TRANSFERS) if arm != "FE4"],
    ),
    Hypothesis(
        "H6e",
        "6",
        "FTW is best early, from its first greedy evaluation on, and collides less.",
        [
            *(beats("low", "FTW", arm, "early area") for arm in ("scratch", *FE, *FT)),
            *(beats("low", "FTW", arm, "jumpstart") for arm in (*FE, *FT)),
            means("low", (*FE, *FT), ("FTW",), "early collisions"),
        ],
    ),
    Hypothesis(
        "H6f",
        "6",
        "FT1 reaches the threshold first.",
        [early("low", "FT1", arm) for arm in ("scratch", *TRANSFERS) if arm != "FT1"],
    ),
    Hypothesis(
        "H7a",
        "7",
        "Arms of one and two layers beat scratch.",
        [beats("lowest", arm, "scratch") for arm in ("FE1", "FE2", "FT1", "FT2")],
    ),
    Hypothesis("H7b", "7", "Finetuning ends above extraction.", [means("lowest", FT, FE, "asymptote")]),
    Hypothesis(
        "H7c",
        "7",
        "The score falls as more layers are transferred.",
        [trend("lowest", *FE[::-1]), trend("lowest", *FT[::-1])],
    ),
    Hypothesis("H7d", "7", "FE4 is below scratch.", [beats("lowest", "scratch", "FE4")]),
    Hypothesis(
        "H7e",
        "7",
        "FT1 to FT4 fall when exploration ends, more than scratch does, and collide more.",
        [
            *(beats("lowest", arm, "scratch", "dip") for arm in FT),
            *(positive("lowest", arm, "collision rise") for arm in FT),
        ],
    ),
    Hypothesis(
        "H7f",
        "7",
        "FTW falls no more than scratch, and gains less late than FT1 to FT4 or ends lower.",
        [
            no_more("lowest", "FTW", "scratch", "dip"),
            either(*(means("lowest", FT, ("FTW",), metric) for metric in ("late gain", "asymptote"))),
        ],
    ),
    Hypothesis("H9a", "9", "A reused network is sooner than a new one.", [confounded, network_effect]),
    Hypothesis(
        "H9b",
        "9",
        "Case 2 is the best source, each case's network trained on it alone.",
        [best_source(case) for case in OTHER_SOURCES],
    ),
]
