"""The margins within which a difference counts as none: conf/analysis.yaml."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from omegaconf import MISSING, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.errors import ConfigError, explain
from ship_trl.config.paths import conf_dir
from ship_trl.study.analysis.metrics import METRICS


@dataclass
class Margins:
    """The margin as a share of the possible gain, and the possible gains by target case and metric."""

    margin: float = MISSING
    gains: dict[str, dict[str, float]] = field(default_factory=dict)


def read_margins(path: Path) -> Margins:
    """Read and check a file of margins.

    Raises:
        ConfigError: an unknown key or metric, or a number that is not above 0.
    """
    try:
        merged = OmegaConf.merge(OmegaConf.structured(Margins), OmegaConf.load(path))
        found: Any = OmegaConf.to_object(merged)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{path.name}: {explain(error)}") from None
    except (yaml.YAMLError, OSError) as error:
        raise ConfigError(f"{path.name}: cannot be read: {' '.join(str(error).split())}") from None
    numbers = {"margin": found.margin}
    for case, gains in found.gains.items():
        numbers |= {f"gains.{case}.{metric}": gain for metric, gain in gains.items()}
        if unknown := sorted(gains.keys() - METRICS.keys()):
            allowed = ", ".join(METRICS)
            raise ConfigError(f"{path.name}: gains.{case}: no metric {unknown[0]}; allowed: {allowed}")
    for key, value in numbers.items():
        if not (math.isfinite(value) and value > 0):
            raise ConfigError(f"{path.name}: {key}: must be above 0, got {value}")
    return Margins(found.margin, found.gains)


@cache
def margins() -> Margins:
    """Read conf/analysis.yaml, once."""
    return read_margins(conf_dir() / "analysis.yaml")


def possible_gain(target: str, metric: str) -> float | None:
    """Return how much transfer could gain in a metric on a target case; None where it was not measured."""
    return margins().gains.get(target, {}).get(metric)


def margin(target: str, metric: str) -> float | None:
    """Return the margin of a metric on a target case; None where the possible gain is unknown."""
    gain = possible_gain(target, metric)
    return None if gain is None else margins().margin * gain
