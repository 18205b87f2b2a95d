"""One run: source network, transfer, training until it ends or a signal stops it, result."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import CURVE
from ship_trl.files.disk import sync
from ship_trl.files.record import RunRecord
from ship_trl.learn.algorithm import DivergedError
from ship_trl.learn.train import Evaluated, Finished, Training
from ship_trl.policies.reference import best_known_return, is_course_best
from ship_trl.run import console
from ship_trl.run.checkpoint import Checkpoints
from ship_trl.run.conclude import make_result, retain, write_files
from ship_trl.run.history import History, to_row
from ship_trl.run.plan import CHECKPOINTS, Run, find_result
from ship_trl.run.process import Stop, StoppedError, configure_process, release_memory, stop_on_signal
from ship_trl.run.setup import Source, make_parts, read_source
from ship_trl.run.trackers import Trackers
from ship_trl.sim.cases import shadowing_file
from ship_trl.transfer.casebase import PLANS, POLICY, CaseBase, StoredNetwork
from ship_trl.transfer.weights import save_weights

# Cases whose best known plan is searched for, which takes a minute or more of each.
MAX_SEARCHES = 10


def run_experiment(run: Run, place: str = "", recipe: str = "") -> RunRecord:
    """Train a run and return its result; if the case base lacks its source network, train that first.

    If the folder holds a finished run of the same settings, its result is shown and nothing is trained.
    `place` is the run's place in a grid, such as `3 of 40`; a run of a grid prints less. `recipe` is the name
    of the recipe that the run takes, which is printed before it is trained.
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
            if recipe:
                console.say(f"recipe {recipe}")
            source = read_source(run, find_source(run.source, run.title, place)) if run.source else given
            result = train_run(run, device, source, place)
        else:
            console.say(f"{run.folder} is already finished; set seed= or output= to train another run")
        # An earlier process may have been killed after it wrote the result and before these two steps.
        retain(run, result)
        remove_checkpoints(run)
    release_memory()
    if place:
        console.say_result(result, run.title, run.folder, place)
    else:
        is_best = is_course_best(run.target, run.config.world, result.best_known_return)
        console.show_result(result, run.title, run.folder, is_best)
    return result


def find_source(source: Run, title: str, place: str) -> StoredNetwork:
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
        remove_checkpoints(source)
    return entry


def remove_checkpoints(run: Run) -> None:
    """Delete the checkpoints of a finished run; while their folder exists, it counts as unfinished."""
    shutil.rmtree(run.folder / CHECKPOINTS, ignore_errors=True)


def train_run(run: Run, device: torch.device, source: Source | None, place: str = "") -> RunRecord:
    """Train one network, and write all files into the run's folder, `result.json` last.

    If an earlier process left a checkpoint of this run, the training resumes from it. The caller holds the
    run's lock. `place` is the run's place in a grid, else empty.

    Raises:
        StoppedError: a signal asked to stop.
        ConfigError: see `make_parts` and `Checkpoints.resume`, or the training diverged.
    """
    started = time.perf_counter()
    # Printed first, because the planner and the jumpstart draws take a while.
    console.say(f"{f'{place}: ' if place else ''}{run.title}, profile {run.config.profile}")
    named = ("suite", run.target.name), ("case", str(run.config.target))
    for kind, name in dict.fromkeys((*named, *(("case", case.name) for case in run.target.cases))):
        if own := shadowing_file(kind, name):
            console.say(f"{kind} {name}: {own}, not the bundled {kind} of this name")
    parts = make_parts(run, device, source)
    checkpoints = Checkpoints(run, parts, started)
    checkpoints.resume(in_a_grid=bool(place))
    plans = Path(run.config.case_base) / PLANS
    known = best_known_return(run.target, run.config.world, plans, MAX_SEARCHES)
    history, training, network = parts.history, parts.training, parts.algorithm.network
    with Trackers(run, history.rows) as trackers:
        # In a resumed run, the file of the best network may be newer than the checkpoint.
        save_best(run, history)
        with stop_on_signal() as stop:
            rows = (to_row(event) for event in train_until_stopped(run, training, checkpoints, stop))
            if (check := parts.source_check) is not None:
                rows = (check.add(row, network) for row in rows)
            last = console.describe_greedy(history.evaluated[-1]) if history.rows else ""
            episodes = run.config.learn.episodes
            for row in console.progress(run.title, episodes, rows, place, training.episode, last):
                trackers.log(row)
                if history.add(row, network):
                    save_best(run, history)
        write_files(run, parts, known)
        result = make_result(run, parts, known, checkpoints.seconds)
        # Flush the curve before the checkpoints, which hold it too, are deleted.
        sync(run.folder / CURVE)
        # Before `trackers.finish`, which may fail or wait for a network.
        result.write(run.folder)
        retain(run, result)
        remove_checkpoints(run)
        trackers.finish(result)
    return result


def train_until_stopped(
    run: Run, training: Training, checkpoints: Checkpoints, stop: Stop
) -> Iterator[Finished | Evaluated]:
    """Train to the end and yield the events; between two steps, write a checkpoint if it is due, or stop."""
    try:
        if not training.has_begun:
            yield training.begin()
        while not training.is_finished:
            yield from training.advance()
            if stop.asked is None and checkpoints.is_due:
                checkpoints.write()
            # The signal may also have come while the checkpoint was written.
            if stop.asked is not None:
                raise StoppedError(checkpoints.stop(), stop.asked)
    except DivergedError as error:
        raise ConfigError(
            f"learn: {error}, at episode {training.episode} of {run.folder}{checkpoints.kept}; "
            "try a smaller learn.lr or learn.reward_scale, or learn.loss=huber"
        ) from None


def save_best(run: Run, history: History) -> None:
    """Write the network of the best evaluation, if there is one."""
    if history.rows:
        about = {"config_hash": run.config_hash, "episode": history.best["episode"]}
        save_weights(run.folder / POLICY, history.network, about)
