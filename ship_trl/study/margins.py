"""The margins within which a difference counts as none: conf/analysis.yaml."""

from __future__ import annotations

from functools import cache
from typing import Any

from omegaconf import OmegaConf

from ship_trl.paths import conf_dir


@cache
def analysis() -> dict[str, Any]:
    """Read conf/analysis.yaml."""
    values: Any = OmegaConf.to_container(OmegaConf.load(conf_dir() / "analysis.yaml"))
    return dict(values)


def margin(target: str, metric: str) -> float | None:
    """Return the margin of a metric on a target case: a share of what could be gained there.

    None where it is not known what could be gained: then nothing is said of equality.
    """
    gain = analysis()["gains"].get(target, {}).get(metric)
    return None if gain is None else float(analysis()["margin"] * gain)
