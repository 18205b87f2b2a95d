"""Train the runs of the study of sources; each is also evaluated on its source's case."""

from __future__ import annotations

import time
from pathlib import Path

import torch
from torch import Tensor

from ship_trl.learn.lockstep import Lockstep
from studies.lockstep import learn, starts
from studies.runs import EVALUATIONS, Row, Setting, Task, make_row

# Evaluations of a run on the source's case, beside the one before training.
ON_SOURCE = 5


def train(tasks: list[Task], setting: Setting, folder: Path, device: str = "cpu") -> list[Row]:
    """Train runs of one length at once; the best networks of sources are written into the folder."""
    began = time.process_time()
    runs = [task.plan(setting, folder) for task in tasks]
    homes = starts(runs, [task.source or task.target for task in tasks]).to(device)
    on_source = list[Tensor]()

    def visit(lockstep: Lockstep, evaluation: int) -> None:
        if evaluation % (EVALUATIONS // ON_SOURCE) == 0:
            on_source.append(lockstep.evaluate(homes[:, None])[0])

    _, *greedy = learn(tasks, runs, setting, folder, visit, device)
    seconds = (time.process_time() - began) / len(tasks)
    shown = [torch.cat(one, 1).tolist() for one in (*greedy, on_source)]
    return [
        make_row(task, setting, returns, goals, kept if task.source else (), seconds)
        for task, returns, goals, kept in zip(tasks, *shown, strict=True)
    ]
