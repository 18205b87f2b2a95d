"""Measures of similarity that ask networks of source and target: they explain gains, not predict them."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ship_trl.explain.cka import cka, gram
from ship_trl.sources import measures
from ship_trl.sources.judgements import ORACLE, SOURCE
from ship_trl.sources.known import Known
from ship_trl.sources.measures import Measure, last_features
from ship_trl.transfer import similarity as of_cases


def cka_of_features(source: Known, target: Known) -> float:
    """Return CKA of the last features of both networks in the target's states."""
    return cka(*(gram(last_features(known.network, target)) for known in (source, target)))


@torch.no_grad()
def q_pair(source: Known, target: Known) -> tuple[Tensor, Tensor]:
    """Return the Q-values of both networks in the target's states, [N, A] each."""
    first, second = (known.network(target.observe(known.network)) for known in (source, target))
    return first, second


def q_distance(source: Known, target: Known) -> float:
    """Return the mean distance of the Q-values, in scaled rewards (Carroll and Seppi, 2005)."""
    first, second = q_pair(source, target)
    return float((first - second).abs().mean())


def policy_agreement(source: Known, target: Known) -> float:
    """Return the share of the target's states where both networks do the same (Carroll and Seppi, 2005)."""
    first, second = q_pair(source, target)
    return float(np.mean((first.argmax(-1) == second.argmax(-1)).numpy()))


ORACLES = {
    "cka": Measure(cka_of_features),
    "q_distance": Measure(q_distance, nearer=True),
    "policy_agreement": Measure(policy_agreement),
}
MEASURES = measures.MEASURES | ORACLES
# What each must know.
KINDS = {
    **dict.fromkeys(MEASURES, SOURCE),
    **dict.fromkeys(of_cases.MEASURES, "cases"),
    **dict.fromkeys(ORACLES, ORACLE),
}
