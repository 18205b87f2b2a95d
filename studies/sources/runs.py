"""Train the runs of the study of sources; each is also evaluated on its source's case."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor

from ship_trl.learn.lockstep import Lockstep
from ship_trl.run.lockstep import learn, starts
from studies.lockstep import EVALUATIONS, Row, Task, make_row, paths_to_keep

# Evaluations of a run on the source's case, beside the one before training.
ON_SOURCE = 5


def train(tasks: list[Task], overrides: Sequence[str], folder: Path, device: str = "cpu") -> list[Row]:
    """Train runs of one length at once; the best networks of sources are written into the folder."""
    began = time.process_time()
    runs = [task.plan(overrides, folder) for task in tasks]
    homes = starts(runs, [task.source or task.target for task in tasks]).to(device)
    on_source = list[Tensor]()

    def visit(lockstep: Lockstep, evaluation: int) -> None:
        if evaluation % (EVALUATIONS // ON_SOURCE) == 0:
            on_source.append(lockstep.evaluate(homes[:, None])[0])

    kept = paths_to_keep(tasks, folder)
    _, greedy, reached = learn(runs, tasks[0].length, EVALUATIONS, kept, visit, device)
    seconds = (time.process_time() - began) / len(tasks)
    shown = [one.tolist() for one in (greedy, reached, torch.cat(on_source, 1))]
    return [
        make_row(task, returns, goals, back if task.source else (), seconds)
        for task, returns, goals, back in zip(tasks, *shown, strict=True)
    ]
