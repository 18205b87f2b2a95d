"""What a training has produced so far: the rows of its curve, and its best network."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping
from typing import Any

from torch import Tensor, nn

from ship_trl.files.curve import COLUMNS
from ship_trl.files.result import Evaluation
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run.rows import row

# Columns of integers and of text; the others hold floats.
INTEGER_COLUMNS = {"episode", "steps", "length", "greedy_length"}
TEXT_COLUMNS = {"outcome", "greedy_outcome"}


class History:
    """All events of a training in order, as rows of `curve.csv`, and its best network.

    Args:
        network: receives the weights of the best network; it has the same layers.

    Attributes:
        rows: one dictionary for each event.
        best: the evaluation with the highest greedy return.
        network: the network with which `best` was reached.
    """

    def __init__(self, network: DuelingNetwork) -> None:
        self.rows: list[dict[str, Any]] = []
        self.best: Evaluated | None = None
        self.network = network

    def add(self, event: Finished | Evaluated, judged: nn.Module) -> bool:
        """Add an event; return whether it evaluates the best network so far, which is `judged`."""
        self.rows.append(row(event))
        if isinstance(event, Finished):
            return False
        # On ties keep the later one: in case 1 even an untrained network may keep its course to the goal.
        if self.best is not None and event.sailed.episode_return < self.best.sailed.episode_return:
            return False
        self.best = event
        self.network.load_state_dict(judged.state_dict())
        return True

    def restore(
        self, text: str, weights: Mapping[str, Tensor], run_episode: Callable[[DuelingNetwork], Episode]
    ) -> None:
        """Load the rows of a curve and its best network, whose greedy episode is run again.

        Raises:
            ValueError, KeyError, RuntimeError: they do not belong to a training of this network.
        """
        self.rows = from_csv(text)
        judged = [values for values in self.rows if "greedy_return" in values]
        best = max(values["greedy_return"] for values in judged)
        last = [values for values in judged if values["greedy_return"] == best][-1]
        self.network.load_state_dict(weights)
        self.best = Evaluated(last["episode"], last["steps"], run_episode(self.network))

    @property
    def finished(self) -> list[Finished]:
        """The training episodes."""
        return [
            Finished(
                episode=values["episode"],
                steps=values["steps"],
                epsilon=values["epsilon"],
                episode_return=values["return"],
                length=values["length"],
                outcome=values["outcome"],
                dcpa=values.get("dcpa", math.inf),
                loss=values.get("loss"),
            )
            for values in self.rows
            if "return" in values
        ]

    @property
    def evaluated(self) -> list[Evaluation]:
        """The greedy evaluations."""
        return [
            Evaluation(
                episode_return=values["greedy_return"],
                outcome=values["greedy_outcome"],
                length=values["greedy_length"],
                dcpa=values.get("greedy_dcpa"),
                episode=values["episode"],
            )
            for values in self.rows
            if "greedy_return" in values
        ]


def to_csv(rows: list[dict[str, Any]]) -> str:
    """Write rows as lines of `curve.csv` without its header; floats keep all digits."""
    text = io.StringIO()
    csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n").writerows(rows)
    return text.getvalue()


def from_csv(text: str) -> list[dict[str, Any]]:
    """Read rows that `to_csv` wrote.

    Raises:
        ValueError: a cell is not a number.
    """
    lines = csv.DictReader(io.StringIO(text), COLUMNS)
    return [{key: convert(key, value) for key, value in line.items() if value != ""} for line in lines]


def convert(column: str, value: str) -> Any:
    """Convert a cell to the type of its column."""
    return value if column in TEXT_COLUMNS else int(value) if column in INTEGER_COLUMNS else float(value)
