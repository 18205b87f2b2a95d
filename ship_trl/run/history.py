"""What a training has given so far: the rows of its curve, and the best network that it was judged by."""

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

# Columns of whole numbers and of words; the others hold numbers.
WHOLE = {"episode", "steps", "length", "greedy_length"}
WORDS = {"outcome", "greedy_outcome"}


class History:
    """The events of a training, as the rows of `curve.csv`, all of them and in order.

    `best` is the evaluation of the highest greedy return, and `network` holds the weights that sailed it.

    Args:
        network: one like the network that is judged.
    """

    def __init__(self, network: DuelingNetwork) -> None:
        self.rows: list[dict[str, Any]] = []
        self.best: Evaluated | None = None
        self.network = network

    def add(self, event: Finished | Evaluated, judged: nn.Module) -> bool:
        """Add an event; returns whether the network that was `judged` is the best so far."""
        self.rows.append(row(event))
        if isinstance(event, Finished):
            return False
        # Of equals the later: in case 1 a network that has learned nothing may keep course.
        if self.best is not None and event.sailed.episode_return < self.best.sailed.episode_return:
            return False
        self.best = event
        self.network.load_state_dict(judged.state_dict())
        return True

    def restore(
        self, text: str, weights: Mapping[str, Tensor], sail: Callable[[DuelingNetwork], Episode]
    ) -> None:
        """Take over the rows of a curve and the weights of its best network, which sails its episode again.

        Raises:
            ValueError, KeyError, RuntimeError: they are not of a training of this network.
        """
        self.rows = from_csv(text)
        judged = [values for values in self.rows if "greedy_return" in values]
        best = max(values["greedy_return"] for values in judged)
        last = [values for values in judged if values["greedy_return"] == best][-1]
        self.network.load_state_dict(weights)
        self.best = Evaluated(last["episode"], last["steps"], sail(self.network))

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
    """Write rows as lines of `curve.csv` without its head; floats in full, so that equal rows are equal."""
    text = io.StringIO()
    csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n").writerows(rows)
    return text.getvalue()


def from_csv(text: str) -> list[dict[str, Any]]:
    """Read what `to_csv` wrote.

    Raises:
        ValueError: a number that is none.
    """
    lines = csv.DictReader(io.StringIO(text), COLUMNS)
    return [{key: typed(key, value) for key, value in line.items() if value != ""} for line in lines]


def typed(column: str, value: str) -> Any:
    """Read a value of a column."""
    return value if column in WORDS else int(value) if column in WHOLE else float(value)
