"""One run: source network, transfer, training on the target case, result."""

from __future__ import annotations

from pathlib import Path

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.files.result import Result
from ship_trl.run import console
from ship_trl.run.checkpoint import Checkpoints
from ship_trl.run.conclude import retain
from ship_trl.run.folder import find_result
from ship_trl.run.process import configure_process, release_memory
from ship_trl.run.run import Run
from ship_trl.run.source import read_source
from ship_trl.run.training import train_run
from ship_trl.transfer.casebase import CaseBase, Entry


def run_experiment(run: Run, place: str = "") -> Result:
    """Train a run, and its source first if the case base lacks it, and return the result.

    A finished run of the same settings is shown again, not trained again.

    Args:
        run: what to train.
        place: its place in a grid, such as `3 of 40`; a run of a grid prints less.
    """
    configure_process()
    device = torch.device(run.config.device)
    if device.type == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device: no CUDA device is available here; allowed: cpu")
    # A file that cannot be used is refused before anything is written.
    given = read_source(run) if run.source is None else None
    # Of two processes with the same run the second waits and finds it done. That happens when a study was
    # killed and started again.
    with console.hold(run.lock(), run.title):
        # Since planning, a run of other settings may have finished in this folder.
        result = find_result(run)
        if result is None:
            source = read_source(run, find_source(run.source, run.title, place)) if run.source else given
            result = train_run(run, device, source, place)
        else:
            console.say(f"{run.folder} holds this run already; another seed= or output= trains one")
        # A process may have been killed after the result was written and before these two steps.
        retain(run, result)
        Checkpoints(run.folder).remove()
    release_memory()
    console.say_result(result, run.folder, place) if place else console.show_result(result, run.folder)
    return result


def find_source(source: Run, title: str, place: str) -> Entry:
    """Find a source network in the case base, or train and keep it first.

    If several processes want the same one, the first trains it and the others wait.

    Args:
        source: the run that trains it.
        title: what it is needed for.
        place: the place in a grid of the run that needs it.
    """
    base, device = CaseBase(Path(source.config.case_base)), torch.device(source.config.device)
    wanted = (source.target, source.entry_arm, source.config.seed, source.config_hash)
    with console.hold(base.lock(*wanted), source.title):
        entry = base.find(*wanted)
        if entry is None:
            # It may be trained as a run of its own at the same time.
            with console.hold(source.lock(), source.title):
                result = find_result(source)
                if result is None:
                    console.say(f"two trainings: first the source, {source.title}; then {title}")
                    result = train_run(source, device, None, place)
                entry = retain(source, result)
                Checkpoints(source.folder).remove()
            return entry
    if find_result(source) is not None:
        # The process that trained it may have been killed before it did this.
        Checkpoints(source.folder).remove()
    console.say(f"source: {entry.policy} (greedy return {entry.best_return:.1f})")
    return entry
