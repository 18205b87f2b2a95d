"""One run: source network, transfer, training until it ends or a signal stops it, its files and result."""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ship_trl import __version__
from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import non_default_network
from ship_trl.files.curve import CURVE, RunError
from ship_trl.files.disk import remove, sync
from ship_trl.files.record import SCHEMA_VERSION, RunRecord, SourceReturns, read_run
from ship_trl.learn.algorithm import DivergedError
from ship_trl.learn.train import Evaluated, Finished, Training
from ship_trl.policies import pretrained
from ship_trl.policies.reference import best_known_return, is_course_best, random_return
from ship_trl.run import console
from ship_trl.run.checkpoint import Checkpoints
from ship_trl.run.history import History, to_evaluation, to_row
from ship_trl.run.plan import ALGORITHM_VERSION, CHECKPOINTS, LAST_CHECKPOINT, Run, find_result, hash_of
from ship_trl.run.process import (
    Stop,
    StoppedError,
    configure_process,
    processor_name,
    release_memory,
    stop_on_signal,
)
from ship_trl.run.setup import Parts, Source, make_parts, read_source
from ship_trl.run.trackers import Trackers
from ship_trl.sim.cases import describe, shadowing_file
from ship_trl.sim.state import first_case
from ship_trl.transfer.casebase import PLANS, POLICY, POLICY_LAST, CaseBase, StoredNetwork
from ship_trl.transfer.weights import save_weights
from ship_trl.view.charts import draw_curve, draw_transfer
from ship_trl.view.film import write_gif

# Cases whose best known plan is searched for, which takes a minute or more of each.
MAX_SEARCHES = 10


def run_experiment(run: Run, place: str = "", recipe: str = "") -> RunRecord:
    """Train a run and return its result; if the case base lacks its source network, train that first.

    If the folder holds a finished run of the same settings, its result is shown and nothing is trained.
    `place` is the run's place in a grid, such as `3 of 40`; a run of a grid prints less. `recipe` is the name
    of the recipe that the run takes, which is printed before it is trained.
    """
    configure_process()
    if torch.device(run.config.device).type == "cuda" and not torch.cuda.is_available():
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
            result = train_run(run, source, place)
        else:
            then = "set seed= or output= to train another run, or learn.episodes= and extend=true to go on"
            console.say(f"{run.folder} is already finished; {then}")
        conclude(run, result)
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
    base = CaseBase(Path(source.config.case_base))
    wanted = (source.target, source.entry_arm, source.config.seed, source.config_hash)
    with console.hold(base.lock(*wanted), source.title):
        if (entry := base.find(*wanted)) is not None:
            console.say(f"source: {entry.policy} (greedy return {entry.best_return:.1f})")
            # The process that trained it may have been killed before this step.
            if find_result(source) is not None:
                shutil.rmtree(source.folder / CHECKPOINTS, ignore_errors=True)
            return entry
        # Another process may train it at the same time, as a run of its own.
        with console.hold(source.lock(), source.title):
            result = find_result(source)
            if result is None:
                console.say(f"training the source first: {source.title}; then {title}")
                result = train_run(source, None, place)
            return conclude(source, result)


def conclude(run: Run, result: RunRecord) -> StoredNetwork:
    """Store a finished run's network for later targets (section 4.2), and delete its checkpoints.

    Whoever finds a run finished calls this too: the process that trained it may have been killed before.
    """
    values, config = result.to_json(), run.config
    scores = {key: values[key] for key in ("best", "final", "best_known_return")}
    named = run.target, run.entry_arm, config.seed, run.config_hash
    network = non_default_network(config.network)
    entry = CaseBase(Path(config.case_base)).retain(*named, scores, run.folder, network)
    # Last: while they exist, a study counts the run as unfinished.
    shutil.rmtree(run.folder / CHECKPOINTS, ignore_errors=True)
    return entry


def train_run(run: Run, source: Source | None, place: str = "") -> RunRecord:
    """Train one network, and write all files into the run's folder, `result.json` last.

    If an earlier process left a checkpoint of this run, the training resumes from it. An extension begins
    with the last checkpoint of the run before. The caller holds the run's lock. `place` is the run's place in
    a grid, else empty.

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
    parts = make_parts(run, torch.device(run.config.device), source)
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
        # Before the trackers, which may fail or wait for a network.
        result.write(run.folder)
        if not run.config.checkpoint.keep:
            remove(run.folder / LAST_CHECKPOINT)
        trackers.finish(result)
    return result


def train_until_stopped(
    run: Run, training: Training, checkpoints: Checkpoints, stop: Stop
) -> Iterator[Finished | Evaluated]:
    """Train to the end and yield the events; between two steps, write a checkpoint if it is due, or stop."""
    try:
        while not training.is_finished:
            yield from training.advance()
            if stop.asked is None and checkpoints.is_due:
                checkpoints.write()
            # The signal may also have come while the checkpoint was written.
            if stop.asked is not None:
                raise StoppedError(checkpoints.stop(), stop.asked)
        checkpoints.write_last()
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


def write_files(run: Run, parts: Parts, known: float | None) -> None:
    """Write the last network and the pictures into the run's folder; `known` is the best known return."""
    history, config, folder = parts.history, run.config, run.folder
    about = {"config_hash": run.config_hash, "episode": config.learn.episodes}
    save_weights(folder / POLICY_LAST, parts.algorithm.network, about)
    draw_curve(folder / "curve.png", history.rows, known, run.title)
    if parts.origin is not None and (scratch := scratch_returns(run)) is not None:
        returns = [row["return"] for row in history.finished]
        draw_transfer(folder / console.TRANSFER, config.arm_label, returns, scratch, known, run.title)
    origin = "" if run.arm.is_scratch else f" from {describe(str(config.source))}"
    suite = f", suite {run.target.name}" if len(run.target.cases) > 1 else ""
    title = f"{config.arm_label}{origin}, seed {config.seed}{suite}"
    best, network = parts.evaluate(history.network)[0], history.network
    case, rasteriser = first_case(run.target, best.states[0]), parts.eval_env.rasteriser
    write_gif(folder / "episode.gif", case, config.world, best, rasteriser, title, network)


def scratch_returns(run: Run) -> NDArray[np.float64] | None:
    """Return raw training returns [S, E] of runs from scratch that differ only in the transfer and the seed.

    They are in the run's output folder or among the bundled curves; None if there are none. Runs that were
    extended to as many episodes count too.
    """
    scratch, manifest = run.config.with_arm(SCRATCH), pretrained.read()

    def digest(seed: int, **given: Any) -> str:
        config = dataclasses.replace(scratch, seed=seed)
        return hash_of(config, run.target, None, demonstrations=run.demonstrations, **given)

    curves: dict[str, NDArray[np.float64]] = {}
    for label in sorted({run.config.label, run.target.name}):
        for folder in sorted((Path(scratch.output) / label / scratch.arm_label).glob("seed=*")):
            with contextlib.suppress(RunError):
                found = read_run(folder)
                is_wanted = found.config_hash == digest(found.seed, extended=found.extended)
                returns = found.training.returns if is_wanted else ()
                # A copied curve may be truncated at the end of a line.
                if len(returns) == scratch.learn.episodes:
                    curves[found.config_hash] = np.asarray(returns)
    seeds = {one["seed"] for one in manifest["runs"]}
    bundled = {digest(seed, version=manifest["algorithm_version"]) for seed in seeds}
    for name, rows in pretrained.training_returns(bundled).groupby("config_hash", sort=False):
        curves.setdefault(str(name), rows["return"].to_numpy())
    return np.stack(list(curves.values())) if curves else None


def make_result(run: Run, parts: Parts, known: float | None, seconds: float) -> RunRecord:
    """Make the result of a training that took `seconds`."""
    history, config = parts.history, run.config
    outcomes = [row["outcome"] for row in history.finished]
    return RunRecord(
        folder=run.folder,
        pair=config.label,
        source=None if run.arm.is_scratch else str(config.source),
        target=str(config.target),
        **run.arm.keys,
        arm=config.arm_label,
        seed=config.seed,
        profile=config.profile,
        config_hash=run.config_hash,
        source_network=parts.origin,
        best_known_return=known,
        random_return=random_return(run.target, config.world, fast=config.fast),
        untrained=to_evaluation(to_row(Evaluated(0, 0, parts.untrained))),
        before=to_evaluation(history.evaluated[0]),
        best=to_evaluation(history.best),
        final=to_evaluation(history.evaluated[-1]),
        draws=parts.draws,
        episodes=config.learn.episodes,
        steps=parts.training.steps,
        training_goal_rate=outcomes.count("goal") / len(outcomes),
        training_collision_rate=outcomes.count("collision") / len(outcomes),
        device=str(parts.eval_env.device),
        precision=str(parts.algorithm.dtype).removeprefix("torch."),
        backend=parts.algorithm.backend,
        algorithm_version=ALGORITHM_VERSION,
        schema_version=SCHEMA_VERSION,
        ship_trl=__version__,
        torch=torch.__version__,
        processor=processor_name(),
        seconds=round(seconds, 1),
        teacher=parts.teacher,
        on_source=measure_source(run, parts),
        extended=[*run.extended],
    )


def measure_source(run: Run, parts: Parts) -> SourceReturns | None:
    """Return what a transfer kept of its source; None if it was not measured from the start."""
    check, suite, rows = parts.source_check, run.source_suite, parts.history.evaluated
    if check is None or suite is None:
        return None
    config = run.config
    return SourceReturns(
        network=check.source_return,
        before=rows[0]["source_return"],
        best=check.measure(parts.history.network),
        final=rows[-1]["source_return"],
        random=random_return(suite, config.world, fast=config.fast),
        best_known=best_known_return(suite, config.world, Path(config.case_base) / PLANS),
    )
