"""A run's events as the columns of `curve.csv`, and as the named numbers of wandb and TensorBoard."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from ship_trl.learn.train import Evaluated, Finished


def row(event: Finished | Evaluated) -> dict[str, Any]:
    """Write an event as columns of `curve.csv`; a greedy evaluation fills its own columns only."""
    if isinstance(event, Finished):
        values = dataclasses.asdict(event)
        values["return"] = values.pop("episode_return")
        return known(values)
    sailed = event.sailed
    values = {
        "episode": event.episode,
        "steps": event.steps,
        "greedy_return": sailed.episode_return,
        "greedy_length": sailed.length,
        "greedy_outcome": sailed.outcome,
        "greedy_dcpa": sailed.dcpa,
    }
    return known(values)


def known(values: dict[str, Any]) -> dict[str, Any]:
    """Without what there is not: a loss before the first update, a DCPA without target ships."""
    return {key: v for key, v in values.items() if v is not None and (isinstance(v, str) or math.isfinite(v))}


def numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """Give a row's numbers by their names, below train/ or greedy/; an outcome is 0 or 1 for each end."""
    kind = "train" if "return" in values else "greedy"
    found: dict[str, float] = {}
    for key, value in values.items():
        name = key.removeprefix("greedy_")
        if name == "outcome":
            found |= {f"{kind}/{end}": int(value == end) for end in ("goal", "collision")}
        elif key != "episode":
            found[f"{kind}/{name}"] = value
    return found
