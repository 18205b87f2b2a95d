"""One run: source network -> transfer -> training on the target case -> result."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Generator

from ship_trl.config.errors import ConfigError
from ship_trl.files.result import Result
from ship_trl.learn.network import DuelingNetwork
from ship_trl.run import console
from ship_trl.run.checkpoint import Checkpoints
from ship_trl.run.conclude import retain
from ship_trl.run.folder import check_folder
from ship_trl.run.parts import source_weights
from ship_trl.run.plan import Run
from ship_trl.run.process import configure_process, release_memory
from ship_trl.run.training import train_run
from ship_trl.transfer.casebase import CaseBase, Entry
from ship_trl.transfer.layers import load_weights


def run_experiment(run: Run, place: str = "") -> Result:
    """Train a run, its source first where the case base has none, and return its result.

    A finished run of the same settings is shown again, not trained again. A run of a grid shows
    less of itself; `place` is its place there, as `3 of 40`.
    """
    configure_process()
    device = torch.device(run.config.device)
    if device.type == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device: no CUDA device is available here; allowed: cpu")
    if run.config.source_file is not None or run.pretrained is not None:
        # Refused before anything is written.
        config = run.config
        network = DuelingNetwork(
            3 if config.colour else 1, len(config.world.actions), Generator(), config.network
        )
        path, key = source_weights(run, None)
        load_weights(path, network, key)
    # Of two processes that are asked for the same run, as after a study was killed and started again,
    # the second waits and finds it done.
    with console.held(run.lock(), run.title):
        result = run.result()
        if result is None:
            # It may have finished other settings in this folder since this run was planned.
            check_folder(run)
            source = find_source(run, place)
            result = train_run(run, device, source, place)
        else:
            console.say(f"{run.folder} holds this run already; another seed= or output= trains one")
        # A process may have been killed between the result and these two.
        retain(run, result)
        Checkpoints(run.folder).remove()
    release_memory()
    console.say_result(result, run.folder, place) if place else console.show_result(result, run.folder)
    return result


def find_source(run: Run, place: str) -> Entry | None:
    """Find the source network of a transfer in the case base, or train and retain it first.

    Of several processes that want the same one, the first trains it and the others wait.
    """
    source = run.source
    if source is None:
        return None
    base, device = CaseBase(Path(source.config.case_base)), torch.device(source.config.device)
    wanted = (source.target, source.config.arm, source.config.seed, source.config_hash)
    with console.held(base.lock(*wanted), source.title):
        entry = base.find(*wanted)
        if entry is None:
            # It may be asked for as a run of its own at the same time.
            with console.held(source.lock(), source.title):
                result = source.result()
                if result is None:
                    check_folder(source)
                    console.say(f"two trainings: first the source, {source.title}; then {run.title}")
                    result = train_run(source, device, None, place)
                entry = retain(source, result)
                Checkpoints(source.folder).remove()
            return entry
    if source.result() is not None:
        # As above, of a process that was killed.
        Checkpoints(source.folder).remove()
    console.say(f"source: {entry.policy} (greedy return {entry.best_return:.1f})")
    return entry
