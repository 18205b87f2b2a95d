"""The results of a training so far: the rows of `curve.csv`, and the best network."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from collections.abc import Callable, Mapping
from typing import Any

from torch import Tensor, nn

from ship_trl.files.curve import COLUMNS
from ship_trl.files.record import Evaluation
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode
from ship_trl.learn.train import Evaluated, Finished

Row = dict[str, Any]
# Types of the columns of `curve.csv`; the others hold floats.
TYPES = {
    **dict.fromkeys(("episode", "steps", "length", "greedy_length", "greedy_episodes"), int),
    **dict.fromkeys(("outcome", "greedy_outcome"), str),
}


class History:
    """All events of a training in order, as rows of `curve.csv`, and its best network.

    `best` is the evaluation with the highest greedy return. `network` gets the weights that reached it.
    """

    def __init__(self, network: DuelingNetwork) -> None:
        self.rows: list[Row] = []
        self.best: Evaluated | None = None
        self.network = network

    def add(self, event: Finished | Evaluated, evaluated: nn.Module) -> bool:
        """Add an event; return whether it is an evaluation, and `evaluated` is the best network so far."""
        self.rows.append(to_row(event))
        if isinstance(event, Finished):
            return False
        # On ties keep the later one: in case 1 even an untrained network may keep its course to the goal.
        if self.best is not None and event.episode_return < self.best.episode_return:
            return False
        self.best = event
        self.network.load_state_dict(evaluated.state_dict())
        return True

    def restore(
        self, text: str, weights: Mapping[str, Tensor], evaluate: Callable[[DuelingNetwork], list[Episode]]
    ) -> None:
        """Load the rows of a curve and its best network, and run that network's greedy episodes again."""
        self.rows = from_csv(text)
        # On ties the later one, as in `add`.
        evaluations = [row for row in reversed(self.rows) if "greedy_return" in row]
        best = max(evaluations, key=lambda row: row["greedy_return"])
        self.network.load_state_dict(weights)
        self.best = Evaluated(best["episode"], best["steps"], evaluate(self.network))

    @property
    def finished(self) -> list[Finished]:
        """All finished training episodes, in order."""
        return [
            Finished(
                **{key: values[key] for key in ("episode", "steps", "length", "outcome")},
                epsilon=values.get("epsilon", math.nan),
                episode_return=values["return"],
                dcpa=values.get("dcpa", math.inf),
                loss=values.get("loss"),
            )
            for values in self.rows
            if "return" in values
        ]

    @property
    def source_returns(self) -> list[float]:
        """All returns on the source, in order."""
        return [row["source_return"] for row in self.rows if "source_return" in row]

    @property
    def evaluated(self) -> list[Evaluation]:
        """All greedy evaluations, in order."""
        return [
            Evaluation(
                episode=values["episode"],
                dcpa=values.get("greedy_dcpa"),
                episode_return=values["greedy_return"],
                **{key: values[f"greedy_{key}"] for key in ("outcome", "length", "success_rate", "episodes")},
            )
            for values in self.rows
            if "greedy_return" in values
        ]


def summarise(evaluated: Evaluated) -> Evaluation:
    """Summarise a greedy evaluation. Of two outcomes that are as frequent, the worse one is named."""
    episodes, count = evaluated.episodes, len(evaluated.episodes)
    outcomes, dcpa = [one.outcome for one in episodes], min(one.dcpa for one in episodes)
    return Evaluation(
        episode_return=evaluated.episode_return,
        outcome=max(("collision", "timeout", "goal"), key=outcomes.count),
        length=round(sum(one.length for one in episodes) / count),
        dcpa=dcpa if math.isfinite(dcpa) else None,
        episode=evaluated.episode,
        success_rate=evaluated.success_rate,
        episodes=count,
    )


def to_row(event: Finished | Evaluated) -> Row:
    """Turn an event into a row of `curve.csv`; a greedy evaluation has its own columns.

    Missing values are left out: the loss before the first update, the DCPA without target ships, epsilon, or
    the return on the source.
    """
    if isinstance(event, Finished):
        values = dataclasses.asdict(event)
        values["return"] = values.pop("episode_return")
    else:
        greedy = dataclasses.asdict(summarise(event))
        greedy["return"] = greedy.pop("episode_return")
        values = {"episode": greedy.pop("episode"), "steps": event.steps}
        values |= {f"greedy_{key}": value for key, value in greedy.items()}
        values["source_return"] = event.source_return
    return {key: v for key, v in values.items() if v is not None and (isinstance(v, str) or math.isfinite(v))}


def to_numbers(row: Row) -> dict[str, float]:
    """Return a row's numbers by names like `train/return`; `goal` and `collision` are 0 or 1."""
    kind = "train" if "return" in row else "greedy"
    found: dict[str, float] = {}
    for key, value in row.items():
        name = key.removeprefix("greedy_")
        if name == "outcome":
            found |= {f"{kind}/{end}": int(value == end) for end in ("goal", "collision")}
        elif key not in ("episode", "greedy_episodes"):
            found[f"{kind}/{name}"] = value
    return found


def to_csv(rows: list[Row]) -> str:
    """Write rows as lines of `curve.csv` without its header; floats keep all digits."""
    text = io.StringIO()
    csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n").writerows(rows)
    return text.getvalue()


def from_csv(text: str) -> list[Row]:
    """Read rows that `to_csv` wrote; raise a `ValueError` if a cell is not a number."""
    lines = csv.DictReader(io.StringIO(text), COLUMNS)
    return [{key: TYPES.get(key, float)(value) for key, value in line.items() if value} for line in lines]
