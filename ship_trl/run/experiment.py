"""One run: source network, transfer, training on the target case, result."""

from __future__ import annotations

from pathlib import Path

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.files.record import RunRecord
from ship_trl.policies.reference import is_course_best
from ship_trl.run import console
from ship_trl.run.checkpoint import Checkpoints
from ship_trl.run.conclude import retain
from ship_trl.run.folder import find_result
from ship_trl.run.process import configure_process, release_memory
from ship_trl.run.run import Run
from ship_trl.run.source import read_source
from ship_trl.run.training import train_run
from ship_trl.transfer.casebase import CaseBase, Entry


def run_experiment(run: Run, place: str = "") -> RunRecord:
    """Train a run and return its result; if the case base lacks its source network, train that first.

    If the folder holds a finished run of the same settings, its result is shown and nothing is trained.
    `place` is the run's place in a grid, such as `3 of 40`; a run of a grid prints less.
    """
    configure_process()
    device = torch.device(run.config.device)
    if device.type == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device: no CUDA device is available here; allowed: cpu")
    # Refuse an unusable file before anything is written.
    given = read_source(run) if run.source is None else None
    # Two processes may have the same run, if a study was killed and started again. The second one waits, and
    # then finds the run finished.
    with console.hold(run.lock(), run.title):
        # A run of other settings may have finished in this folder since `make_run` checked it.
        result = find_result(run)
        if result is None:
            source = read_source(run, find_source(run.source, run.title, place)) if run.source else given
            result = train_run(run, device, source, place)
        else:
            console.say(f"{run.folder} is already finished; set seed= or output= to train another run")
        # An earlier process may have been killed after it wrote the result and before these two steps.
        retain(run, result)
        Checkpoints(run.folder).remove()
    release_memory()
    if place:
        console.say_result(result, run.title, run.folder, place)
    else:
        is_best = is_course_best(run.target, run.config.world, result.best_known_return)
        console.show_result(result, run.title, run.folder, is_best)
    return result


def find_source(source: Run, title: str, place: str) -> Entry:
    """Find a source network in the case base; if it is missing, train and store it.

    If several processes need the same network, the first one trains it and the others wait. `title` and
    `place` are those of the run that needs it.
    """
    base, device = CaseBase(Path(source.config.case_base)), torch.device(source.config.device)
    wanted = (source.target, source.entry_arm, source.config.seed, source.config_hash)
    with console.hold(base.lock(*wanted), source.title):
        entry = base.find(*wanted)
        if entry is None:
            # Another process may train it at the same time, as a run of its own.
            with console.hold(source.lock(), source.title):
                result = find_result(source)
                if result is None:
                    console.say(f"training the source first: {source.title}; then {title}")
                    result = train_run(source, device, None, place)
                entry = retain(source, result)
        else:
            console.say(f"source: {entry.policy} (greedy return {entry.best_return:.1f})")
    if find_result(source) is not None:
        # The process that trained it may have been killed before this step.
        Checkpoints(source.folder).remove()
    return entry
