"""The margins within which arms count as equivalent: conf/analysis.yaml."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated

import yaml
from pydantic import Field

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import read_as, rule
from ship_trl.files.untrusted import read_yaml
from ship_trl.study.metrics import METRICS

PositiveNumber = Annotated[float, Field(gt=0)]
Gains = Annotated[
    dict[str, PositiveNumber],
    rule(f"gains of {', '.join(METRICS)}", lambda gains: gains.keys() <= METRICS.keys()),
]


@dataclass
class Margins:
    """The margin as a share of the possible gain, and the possible gains by target case and metric."""

    margin: PositiveNumber
    gains: dict[str, Gains] = field(default_factory=dict)


def read_margins(path: Path) -> Margins:
    """Read and check a file of margins."""
    try:
        values = read_yaml(path)
    except (yaml.YAMLError, OSError) as error:
        raise ConfigError(f"{path.name}: cannot be read: {' '.join(str(error).split())}") from None
    return read_as(Margins, values, f"{path.name}: ")


@cache
def margins() -> Margins:
    """Read conf/analysis.yaml, once."""
    return read_margins(conf_dir() / "analysis.yaml")


def possible_gain(target: str, metric: str) -> float | None:
    """Return how much transfer could gain in a metric on a target case; None if it was not measured."""
    return margins().gains.get(target, {}).get(metric)


def margin(target: str, metric: str) -> float | None:
    """Return the margin of a metric on a target case; None if the possible gain is unknown."""
    gain = possible_gain(target, metric)
    return None if gain is None else margins().margin * gain
