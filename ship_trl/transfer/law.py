"""The law of transfer: the gain that is expected from a source on a target, by fitted coefficients. No torch.

    gain = constant + quality of the source + difficulty of the target + closeness of both

Gains are those of FTW over scratch in mean greedy score. `python -m studies.law` fits the coefficients on 812
pairs of cases and writes `law.json`; studies/law/README.md says how well they predict.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.transfer.similarity import MEASURES, characteristics

ARM = "FTW"
FILE = Path(__file__).parent / "law.json"
# Columns of the fits: what describes a case, and the measures of two cases that the kept tables have.
OF_CASE = ("target ships", "danger", "tcpa", "straight")
OF_CASES = ("similarity", "distance", "side", "ships")
ZERO_SHOT = "zero_shot"
SOURCE, TARGET = "source: ", "target: "


class Column(NamedTuple):
    """A column of a fit: mean and deviation over its rows, and the weight of the standardised value."""

    mean: float
    scale: float
    weight: float


class Expected(NamedTuple):
    """An expected gain, the 90 % interval of a run on a new target, and the terms that add up to the gain."""

    gain: float
    low: float
    high: float
    constant: float
    quality: float
    difficulty: float
    closeness: float


@dataclass(frozen=True)
class Law:
    """A fit: its columns, effects of known cases by fingerprint, and how far 90 % intervals reach."""

    constant: float
    columns: dict[str, Column]
    sources: dict[str, float]
    targets: dict[str, float]
    reach: float

    def expect(self, source: Case, target: Case, values: Mapping[str, float]) -> Expected:
        """Return the expected gain from the columns of `describe`, and `zero_shot` if the fit has it."""
        quality = self.sources.get(source.fingerprint, 0.0)
        difficulty, closeness = self.targets.get(target.fingerprint, 0.0), 0.0
        for name, (mean, scale, weight) in self.columns.items():
            part = weight * (values[name] - mean) / scale
            if name.startswith(SOURCE):
                quality += part
            elif name.startswith(TARGET):
                difficulty += part
            else:
                closeness += part
        gain = self.constant + quality + difficulty + closeness
        return Expected(
            gain, gain - self.reach, gain + self.reach, self.constant, quality, difficulty, closeness
        )


@cache
def load_laws() -> tuple[Law, Law]:
    """Return the fit that needs nothing trained, and the one that also takes the source's zero-shot score."""
    one, other = (
        Law(**values | {"columns": {key: Column(*numbers) for key, numbers in values["columns"].items()}})
        for values in json.loads(FILE.read_text())
    )
    return one, other


def describe(source: Case, target: Case, world: World) -> dict[str, float]:
    """Return the columns that need nothing trained; larger measures are closer."""
    found: dict[str, float] = {}
    for prefix, case in ((SOURCE, source), (TARGET, target)):
        values = characteristics(case, world) | {"straight": float(case.ideal_path.startswith("straight"))}
        found |= {prefix + name: values[name] for name in OF_CASE}
    for name in OF_CASES:
        measure = MEASURES[name]
        found[name] = (-1 if measure.nearer else 1) * measure.value(source, target, world)
    return found
