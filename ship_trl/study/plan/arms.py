"""The names of a study's arms and control pairs; `Arm` parses the names of arms."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace

from ship_trl.config import arm as arms
from ship_trl.config.arm import ALL_LAYERS, Arm, Method, SourceWeights

SCRATCH, WHOLE = arms.SCRATCH.name, Arm(Method.finetune, ALL_LAYERS).name
FE = tuple(Arm(Method.feature_extraction, n).name for n in range(1, 5))
FT = tuple(Arm(Method.finetune, n).name for n in range(1, 5))
TRANSFERS = (*FE, *FT, WHOLE)
# Controls whose frozen layers hold random weights, or the source's weights permuted within each layer.
RANDOM, PERMUTED = SourceWeights.random.value, SourceWeights.permuted.value
CONTROL_KINDS = (RANDOM, PERMUTED)


def control_arm(arm: str, kind: str) -> str:
    """Return the name of an arm's control."""
    return replace(Arm.parse(arm), weights=SourceWeights(kind)).name


def rivals(names: Iterable[str]) -> list[str]:
    """Return the arms among some names that are neither the paper's nor controls, in their order."""
    found = []
    for name in set(names) - {SCRATCH, *TRANSFERS}:
        with suppress(ValueError):  # networks on the new case have names of their own
            found.append(Arm.parse(name))
    return [arm.name for arm in sorted(found) if arm.weights is SourceWeights.learned]


# Controls of every seed: arms that run on each pair, and pairs with their arms. Pair "self" transfers case 2
# to itself; pair "ship" has a source with the target's ship but another path (section 4.1).
CONTROL_ARMS = tuple(control_arm("FE3", kind) for kind in CONTROL_KINDS)
CONTROL_PAIRS = {"self": (*FE, *FT), "ship": ("FE3", WHOLE)}
# Exploratory controls, only of the first block of seeds.
FIRST_BLOCK_ARMS = tuple(control_arm(f"FE{n}", kind) for kind in CONTROL_KINDS for n in (1, 2, 4))
FIRST_BLOCK_PAIRS = {"self": (WHOLE,), "self4": TRANSFERS, "self6": TRANSFERS}
# A control pair is compared with the runs from scratch of the pair that has the same target.
SCRATCH_PAIR = {"self": "high", "ship": "high", "self4": "low", "self6": "lowest"}
