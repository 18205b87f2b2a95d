"""One network trained: to its last episode, or to where a signal stops it, and on from there."""

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
from ship_trl.sim.cases import in_place_of
from ship_trl.sim.reference import best_known
from ship_trl.transfer.casebase import PLANS, POLICY
from ship_trl.transfer.layers import save_weights


def train_run(run: Run, device: torch.device, source: Source | None, place: str = "") -> Result:
    """Train one network and write everything about it into the run's folder, `result.json` last of its files.

    Where a process left a checkpoint of this run, it goes on from there.

    Raises:
        StoppedError: a signal asked to stop.
        ConfigError: as `make_parts` and `Journal.go_on`, or the training diverged.
    """
    started = time.perf_counter()
    # At once: the planner and the draws before training take their time.
    console.say(f"{place}: {run.title}" if place else run.title)
    if own := in_place_of(str(run.config.target)):
        console.say(f"case {run.config.target}: {own}, not the one of this name that comes with us")
    parts = make_parts(run, device, source)
    journal = Journal(run, parts, started)
    journal.go_on(in_a_grid=bool(place))
    known = best_known(run.target, run.config.world, Path(run.config.case_base) / PLANS).episode_return
    history, training, episodes = parts.history, parts.training, run.config.learn.episodes
    with Tracker(run, history.rows) as tracker:
        # That of a checkpoint may be older than the file.
        save_best(run, history)
        with Stop() as stop:
            events = sail(training, journal, stop)
            for event in console.progress(run.title, episodes, events, place, training.episode):
                tracker.log(event)
                if history.add(event, parts.agent.target_network):
                    save_best(run, history)
        write_files(run, parts, known)
        result = make_result(run, parts, known, journal.seconds)
        # A checkpoint holds the curve too, and goes.
        sync(run.folder / CURVE)
        # Before the trackers, which may fail, or wait for a network. The checkpoints' folder goes last: as
        # long as it is there, something is left to do.
        write_result(run.folder, result)
        retain(run, result)
        journal.checkpoints.remove()
        tracker.finish(result)
    return result


def sail(training: Training, journal: Journal, stop: Stop) -> Iterator[Finished | Evaluated]:
    """Train to the end and yield what happens; between two steps write checkpoints, or stop.

    Raises:
        StoppedError: a signal asked to stop.
        ConfigError: the training diverged.
    """
    try:
        if not training.begun:
            yield training.begin()
        while not training.finished:
            yield from training.advance()
            if stop.asked is not None:
                raise StoppedError(journal.stopped(), stop.asked)
            if journal.checkpoints.due(training.episode):
                journal.write()
        # It may have been asked while the last checkpoint was written.
        if stop.asked is not None:
            raise StoppedError(journal.stopped(), stop.asked)
    except DivergedError as error:
        raise ConfigError(journal.diverged(error)) from None


def save_best(run: Run, history: History) -> None:
    """Write the network of the best evaluation, if there was one."""
    if history.best is not None:
        noted = {"config_hash": run.config_hash, "episode": history.best.episode}
        save_weights(run.folder / POLICY, history.network, noted)
