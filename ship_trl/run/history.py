"""The results of a training so far: the rows of `curve.csv`, and the best network."""

from __future__ import annotations

import dataclasses
import math

from torch import nn

from ship_trl.files.curve import Row
from ship_trl.files.record import Evaluation
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.train import Evaluated, Finished


class History:
    """All events of a training in order, as rows of `curve.csv`; `network` has the weights of the best."""

    def __init__(self, network: DuelingNetwork) -> None:
        self.rows: list[Row] = []
        self.network = network

    @property
    def finished(self) -> list[Row]:
        """The rows of training episodes, in order."""
        return [row for row in self.rows if "return" in row]

    @property
    def evaluated(self) -> list[Row]:
        """The rows of greedy evaluations, in order."""
        return [row for row in self.rows if "greedy_return" in row]

    @property
    def best(self) -> Row:
        """The evaluation with the highest return; there is one."""
        # On ties the later one: in case 1 even an untrained network may keep its course to the goal.
        return max(reversed(self.evaluated), key=lambda row: float(row["greedy_return"]))

    def add(self, row: Row, evaluated: nn.Module) -> bool:
        """Add a row; return whether it is an evaluation, and `evaluated` is the best network so far."""
        self.rows.append(row)
        is_best = "greedy_return" in row and row is self.best
        if is_best:
            self.network.load_state_dict(evaluated.state_dict())
        return is_best


def to_row(event: Finished | Evaluated) -> Row:
    """Turn an event into a row of `curve.csv`; a greedy evaluation has its own columns.

    Missing values are left out: the loss before the first update, the DCPA without target ships, or epsilon.
    """
    if isinstance(event, Finished):
        values = dataclasses.asdict(event)
        values["return"] = values.pop("episode_return")
    else:
        episodes, outcomes = event.episodes, [one.outcome for one in event.episodes]
        values = {
            "episode": event.episode,
            "steps": event.steps,
            "greedy_return": event.episode_return,
            "greedy_length": round(sum(one.length for one in episodes) / len(episodes)),
            # Of two that are as frequent, the worse one.
            "greedy_outcome": max(("collision", "timeout", "goal"), key=outcomes.count),
            "greedy_dcpa": min(one.dcpa for one in episodes),
            "greedy_success_rate": outcomes.count("goal") / len(episodes),
            "greedy_episodes": len(episodes),
        }
    return {key: v for key, v in values.items() if v is not None and (isinstance(v, str) or math.isfinite(v))}


def to_evaluation(row: Row) -> Evaluation:
    """Return the evaluation of a row as a result holds it."""
    own = {key.removeprefix("greedy_"): value for key, value in row.items() if key.startswith("greedy_")}
    return Evaluation(own.pop("return"), episode=row["episode"], **({"dcpa": None} | own))


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
