"""Rows of many episodes for tables and CSV files: rates with intervals, distances, rule scores, detours."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ship_trl.config.bounds import RULES
from ship_trl.policies.registry import Entry
from ship_trl.run.plan import differences
from ship_trl.sim.cases import load_world

if TYPE_CHECKING:
    from ship_trl.learn.rollout import Episode
    from ship_trl.policies.metrics import Measurements

HEADINGS = (
    *("suite", "policy", "episodes", "success", "collision", "timeout", "return", "of best known"),
    *("least distance, m (5 %)", *(f"R{rule}" for rule in RULES), "path", "ms", "claimed"),
)
# What `evaluate` shows unless it is asked for more, and what --rules adds.
SHORT = ("policy", "success", "collision", "timeout", "least distance, m (5 %)")
RULE_SCORES = tuple(f"R{rule}" for rule in RULES)
# Percentile of the least distance, beside its mean.
LOW = 5


@dataclass(frozen=True)
class Scored:
    """The episodes of a policy on a suite.

    Attributes:
        head_on: half-angle of the head-on sector, in degrees.
        seed: of the starts.
    """

    entry: Entry
    episodes: list[Episode]
    head_on: float
    seed: int = 0

    @cached_property
    def measured(self) -> Measurements:
        """The metrics of the episodes."""
        from ship_trl.policies.metrics import measure_episodes

        return measure_episodes(self.episodes, self.entry.world, self.head_on)

    @cached_property
    def decision_time(self) -> float:
        """The median time (ms) of a decision in the first of the scenes with most target ships."""
        from ship_trl.policies.named import time_decision
        from ship_trl.sim.state import SHIP_COUNT

        start = max((one.states[0] for one in self.episodes), key=lambda state: float(state[SHIP_COUNT]))
        return time_decision(self.entry, start, self.seed)

    @property
    def reached(self) -> float:
        """The mean return."""
        return sum(one.episode_return for one in self.episodes) / len(self.episodes)

    @property
    def claimed(self) -> str:
        """The cell of the return that is claimed."""
        return "" if self.entry.claimed is None else f"{self.entry.claimed:.1f}"

    def share(self, best: float | None) -> str:
        """Return the cell of the share that is reached of the best known return."""
        return f"{self.reached / best:.0%}" if best is not None and min(best, self.reached) > 0 else "-"

    @property
    def suite_name(self) -> str:
        """The name of the suite, and whether starts are perturbed."""
        suite = self.entry.suite
        return suite.name + ", perturbed" * (not suite.perturbation.is_none)

    def scene_name(self, row: int) -> str:
        """Return the name of an episode's case, or the seed of its random encounter."""
        suite = self.entry.suite
        if not suite.cases:
            return f"seed {self.seed + row}"
        turn, case = divmod(row, len(suite.cases))
        return suite.cases[case].name + (f" ({turn + 1})" if suite.is_drawn else "")

    def row(self, best: float | None) -> list[str]:
        """Return the cells of `HEADINGS`; `best` is the best known mean return."""
        cells = score_cells(self.measured, self.share(best))
        return [self.suite_name, self.entry.label, *cells, f"{self.decision_time:.2g}", self.claimed]

    def class_rows(self) -> Iterator[list[str]]:
        """Yield the same cells for each class of encounter."""
        for name in sorted(set(self.measured.encounters.tolist())):
            cells = score_cells(self.measured.select(self.measured.encounters == name))
            yield [f"{self.suite_name}: {name}", self.entry.label, *cells, "", ""]

    def csv_rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row of each episode: scene, end and every metric, empty where one does not apply."""
        for k in range(len(self.episodes)):
            values = self.measured.of_episode(k).items()
            yield {
                "policy": self.entry.label,
                "suite": self.entry.suite.name,
                "case": self.scene_name(k),
                "outcome": self.measured.outcomes[k],
                "encounter": self.measured.encounters[k],
                **{name: "" if math.isnan(value) else f"{value:.6g}" for name, value in values},
                "decision_ms": f"{self.decision_time:.3g}",
            }


def score_cells(measured: Measurements, share: str = "-") -> list[str]:
    """Return the cells from `episodes` to `path`, with the share of the best known return."""
    import numpy as np

    count, near = len(measured.outcomes), measured.known("least_distance")
    return [
        str(count),
        *(describe_share(measured, end) for end in ("goal", "collision", "timeout")),
        f"{measured.known('return').mean():.1f}",
        share,
        f"{near.mean():.0f} ({np.percentile(near, LOW):.0f})" if near.size else "-",
        *(describe_mean(measured, f"rule_{rule}") for rule in RULES),
        describe_mean(measured, "path_ratio"),
    ]


def describe_share(measured: Measurements, end: str) -> str:
    """Return the share of an outcome with its 95 % interval: "43% (16 to 75)"."""
    from scipy.stats import binomtest

    found = binomtest(int((measured.outcomes == end).sum()), len(measured.outcomes))
    ends = found.proportion_ci(0.95, method="wilson")
    return f"{found.statistic:.0%} ({100 * ends.low:.0f} to {100 * ends.high:.0f})"


def describe_mean(measured: Measurements, name: str) -> str:
    """Return the mean of a metric where it applies, or a dash."""
    values = measured.known(name)
    return f"{values.mean():.2f}" if values.size else "-"


def describe_worlds(entries: Iterable[Entry]) -> list[str]:
    """Return a line for each world that is not the paper's: keys that differ, and the policies in it."""
    found: dict[str, list[str]] = {}
    for entry in entries:
        changes = ", ".join(differences(entry.world, load_world(), "world"))
        found.setdefault(changes, []).append(entry.label)
    return [f"{changes}: {', '.join(dict.fromkeys(some))}." for changes, some in found.items() if changes]


def describe_scores(safe_distance: float, head_on: float, columns: Sequence[str] = HEADINGS) -> str:
    """Return the line that explains the columns of a table of scores."""
    lines = {
        "success": "95 % intervals (Wilson).",
        RULE_SCORES[0]: "R8 to R17: scores of the steering rules after Hagen et al. 2023, mean over "
        f"encounters, collision radius {safe_distance:g} m.",
        "suite": f"Classes by Pedersen, head-on within {head_on:g} degrees.",
        "ms": "ms: time of a decision in one scene.",
    }
    return " ".join(line for column, line in lines.items() if column in columns)
