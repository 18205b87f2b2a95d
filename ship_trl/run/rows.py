"""Turn events of a training into rows of `curve.csv`, and into named numbers for wandb and TensorBoard."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from ship_trl.learn.train import Evaluated, Finished


def row(event: Finished | Evaluated) -> dict[str, Any]:
    """Turn an event into a row of `curve.csv`; a greedy evaluation has its own columns."""
    if isinstance(event, Finished):
        values = dataclasses.asdict(event)
        values["return"] = values.pop("episode_return")
        return drop_missing(values)
    sailed = event.sailed
    values = {
        "episode": event.episode,
        "steps": event.steps,
        "greedy_return": sailed.episode_return,
        "greedy_length": sailed.length,
        "greedy_outcome": sailed.outcome,
        "greedy_dcpa": sailed.dcpa,
    }
    return drop_missing(values)


def drop_missing(values: dict[str, Any]) -> dict[str, Any]:
    """Drop missing values, such as the loss before the first update or a DCPA without target ships."""
    return {key: v for key, v in values.items() if v is not None and (isinstance(v, str) or math.isfinite(v))}


def numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """Return a row's numbers by names with prefix train/ or greedy/; an outcome becomes a 0 or 1 per kind."""
    kind = "train" if "return" in values else "greedy"
    found: dict[str, float] = {}
    for key, value in values.items():
        name = key.removeprefix("greedy_")
        if name == "outcome":
            found |= {f"{kind}/{end}": int(value == end) for end in ("goal", "collision")}
        elif key != "episode":
            found[f"{kind}/{name}"] = value
    return found
