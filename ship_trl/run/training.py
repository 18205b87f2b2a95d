"""Train one network to its last episode, or until a signal stops it; resume a stopped training."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import CURVE
from ship_trl.files.disk import sync
from ship_trl.files.result import Result, write_result
from ship_trl.learn.train import DivergedError, Evaluated, Finished, Training
from ship_trl.run import console
from ship_trl.run.conclude import make_result, retain, write_files
from ship_trl.run.history import History
from ship_trl.run.journal import Journal
from ship_trl.run.parts import make_parts
from ship_trl.run.run import Run
from ship_trl.run.source import Source
from ship_trl.run.stop import Stop, StoppedError
from ship_trl.run.tracking import Tracker
from ship_trl.sim.cases import shadowing_case
from ship_trl.sim.reference import best_known
from ship_trl.transfer.casebase import PLANS, POLICY
from ship_trl.transfer.layers import save_weights


def train_run(run: Run, device: torch.device, source: Source | None, place: str = "") -> Result:
    """Train one network, and write all files into the run's folder, `result.json` last.

    If an earlier process left a checkpoint of this run, the training resumes from it.

    Args:
        run: the run to train; the caller holds its lock.
        device: device of the networks and environments.
        source: the weights to copy; None from scratch.
        place: the run's place in a grid, else empty.

    Raises:
        StoppedError: a signal asked to stop.
        ConfigError: see `make_parts` and `Journal.resume`, or the training diverged.
    """
    started = time.perf_counter()
    # Printed first, because the planner and the jumpstart draws take a while.
    console.say(f"{place}: {run.title}" if place else run.title)
    if own := shadowing_case(str(run.config.target)):
        console.say(f"case {run.config.target}: {own}, not the bundled case of this name")
    parts = make_parts(run, device, source)
    journal = Journal(run, parts, started)
    journal.resume(in_a_grid=bool(place))
    known = best_known(run.target, run.config.world, Path(run.config.case_base) / PLANS).episode_return
    history, training, episodes = parts.history, parts.training, run.config.learn.episodes
    with Tracker(run, history.rows) as tracker:
        # In a resumed run, the file of the best network may be newer than the checkpoint.
        save_best(run, history)
        with Stop() as stop:
            events = train_until_stopped(training, journal, stop)
            for event in console.progress(run.title, episodes, events, place, training.episode):
                tracker.log(event)
                if history.add(event, parts.agent.target_network):
                    save_best(run, history)
        write_files(run, parts, known)
        result = make_result(run, parts, known, journal.seconds)
        # Flush the curve before the checkpoints, which hold it too, are deleted.
        sync(run.folder / CURVE)
        # Before `tracker.finish`, which may fail or wait for a network. The checkpoint folder is deleted
        # last: while it exists, the run counts as unfinished.
        write_result(run.folder, result)
        retain(run, result)
        journal.checkpoints.remove()
        tracker.finish(result)
    return result


def train_until_stopped(training: Training, journal: Journal, stop: Stop) -> Iterator[Finished | Evaluated]:
    """Train to the end and yield the events; between two steps, write a checkpoint if it is due, or stop.

    Raises:
        StoppedError: a signal asked to stop.
        ConfigError: the training diverged.
    """
    try:
        if not training.has_begun:
            yield training.begin()
        while not training.is_finished:
            yield from training.advance()
            if stop.asked is None and journal.checkpoints.due(training.episode):
                journal.write()
            # The signal may also have come while the checkpoint was written.
            if stop.asked is not None:
                raise StoppedError(journal.stop(), stop.asked)
    except DivergedError as error:
        raise ConfigError(journal.describe_divergence(error)) from None


def save_best(run: Run, history: History) -> None:
    """Write the network of the best evaluation, if there is one."""
    if history.best is not None:
        about = {"config_hash": run.config_hash, "episode": history.best.episode}
        save_weights(run.folder / POLICY, history.network, about)
