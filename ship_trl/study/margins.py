"""The margins within which a difference counts as none: conf/analysis.yaml."""

from __future__ import annotations

from functools import cache
from typing import Any

from omegaconf import OmegaConf

from ship_trl.paths import conf_dir
from ship_trl.study.metrics import TIMES

# Numbers that are no scores and no times: nothing is said of their equality.
WITHOUT = ("early collisions", "collision rise", "fell", "misses", "success", "collisions", "DCPA")


@cache
def analysis() -> dict[str, Any]:
    """Read conf/analysis.yaml."""
    return dict(OmegaConf.to_container(OmegaConf.load(conf_dir() / "analysis.yaml")))  # type: ignore[arg-type]


def margin(target: str, metric: str) -> float | None:
    """Return the margin of a metric on a target case: a share of what could be gained there.

    None where it is not known what could be gained, or the metric is neither a score nor a time.
    """
    gains = analysis()["gains"].get(target)
    if gains is None or metric in WITHOUT:
        return None
    return float(analysis()["margin"] * gains["time" if metric in TIMES else "score"])
