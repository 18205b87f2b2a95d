"""What the names of arms and of control pairs mean. No other file of the study takes a name apart."""

from __future__ import annotations

SCRATCH, WHOLE = "scratch", "FTW"
FE, FT = tuple(f"FE{n}" for n in range(1, 5)), tuple(f"FT{n}" for n in range(1, 5))
TRANSFERS = (*FE, *FT, WHOLE)
# Kinds of controls: the frozen layers hold random weights, or the source's weights permuted within each
# layer.
RANDOM, PERMUTED = "random", "permuted"
CONTROL_KINDS = (RANDOM, PERMUTED)


def control_arm(arm: str, kind: str) -> str:
    """Return the name of an arm's control."""
    return f"{arm}-{kind}"


def is_control(arm: str) -> bool:
    """Return whether the frozen layers of an arm hold no features of its source."""
    return "-" in arm


def control_kind(arm: str) -> str:
    """Return the kind of a control; "" for other arms."""
    return arm.partition("-")[2]


def needs_source(arm: str) -> bool:
    """Return whether an arm begins with a network that was trained."""
    return arm != SCRATCH and control_kind(arm) != RANDOM


# Controls that run with every seed: arms on each pair, and pairs with their arms. Pair "self" transfers case
# 2 to itself; pair "ship" has a source with the target's ship but another path (section 4.1).
CONTROL_ARMS = tuple(control_arm("FE3", kind) for kind in CONTROL_KINDS)
CONTROL_PAIRS = {"self": (*FE, *FT), "ship": ("FE3", WHOLE)}
# Exploratory controls, which run with the first block of seeds only.
FIRST_BLOCK_ARMS = tuple(control_arm(f"FE{n}", kind) for kind in CONTROL_KINDS for n in (1, 2, 4))
FIRST_BLOCK_PAIRS = {"self": (WHOLE,), "self4": TRANSFERS, "self6": TRANSFERS}
# The pair with the same target, whose runs from scratch a control pair is compared with.
SCRATCH_PAIR = {"self": "high", "ship": "high", "self4": "low", "self6": "lowest"}
