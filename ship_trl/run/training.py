"""Train one network to its end or until a signal stops it; write checkpoints, and resume from them."""

from __future__ import annotations

import csv
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import CURVE
from ship_trl.files.disk import remove, sync
from ship_trl.files.record import RunRecord
from ship_trl.learn.algorithm import DivergedError
from ship_trl.learn.prefix import add_prefix, strip_prefix
from ship_trl.learn.train import Evaluated, Finished, Training
from ship_trl.policies.reference import best_known_return
from ship_trl.run import console
from ship_trl.run.checkpoint import About, Checkpoints
from ship_trl.run.conclude import make_result, retain, write_files
from ship_trl.run.history import History, to_csv
from ship_trl.run.parts import Parts, make_parts
from ship_trl.run.run import Run
from ship_trl.run.source import Source
from ship_trl.run.stop import Stop, StoppedError, stop_on_signal
from ship_trl.run.tracking import Tracker
from ship_trl.sim.cases import shadowing_file
from ship_trl.transfer.casebase import PLANS, POLICY
from ship_trl.transfer.weights import save_weights

# Cases whose best known plan is searched for, which takes a minute or more of each.
MAX_SEARCHES = 10


def train_run(run: Run, device: torch.device, source: Source | None, place: str = "") -> RunRecord:
    """Train one network, and write all files into the run's folder, `result.json` last.

    If an earlier process left a checkpoint of this run, the training resumes from it. The caller holds the
    run's lock. `place` is the run's place in a grid, else empty.

    Raises:
        StoppedError: a signal asked to stop.
        ConfigError: see `make_parts` and `Journal.resume`, or the training diverged.
    """
    started = time.perf_counter()
    # Printed first, because the planner and the jumpstart draws take a while.
    console.say(f"{f'{place}: ' if place else ''}{run.title}, profile {run.config.profile}")
    named = ("suite", run.target.name), ("case", str(run.config.target))
    for kind, name in dict.fromkeys((*named, *(("case", case.name) for case in run.target.cases))):
        if own := shadowing_file(kind, name):
            console.say(f"{kind} {name}: {own}, not the bundled {kind} of this name")
    parts = make_parts(run, device, source)
    journal = Journal(run, parts, started)
    journal.resume(in_a_grid=bool(place))
    plans = Path(run.config.case_base) / PLANS
    known = best_known_return(run.target, run.config.world, plans, MAX_SEARCHES)
    history, training, episodes = parts.history, parts.training, run.config.learn.episodes
    with Tracker(run, history.rows) as tracker:
        # In a resumed run, the file of the best network may be newer than the checkpoint.
        save_best(run, history)
        with stop_on_signal() as stop:
            events = train_until_stopped(training, journal, stop)
            if (check := parts.source_check) is not None:
                events = (check.add(event, parts.algorithm.network) for event in events)
            last = [
                console.describe_greedy(one.episode_return, one.success_rate, one.episodes)
                for one in history.evaluated[-1:]
            ]
            for event in console.progress(run.title, episodes, events, place, training.episode, *last):
                tracker.log(event)
                if history.add(event, parts.algorithm.network):
                    save_best(run, history)
        write_files(run, parts, known)
        result = make_result(run, parts, known, journal.seconds)
        # Flush the curve before the checkpoints, which hold it too, are deleted.
        sync(run.folder / CURVE)
        # Before `tracker.finish`, which may fail or wait for a network. The checkpoint folder is deleted
        # last: while it exists, the run counts as unfinished.
        result.write(run.folder)
        retain(run, result)
        journal.checkpoints.remove()
        tracker.finish(result)
    return result


def train_until_stopped(training: Training, journal: Journal, stop: Stop) -> Iterator[Finished | Evaluated]:
    """Train to the end and yield the events; between two steps, write a checkpoint if it is due, or stop."""
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


class Journal:
    """Writes checkpoints of a training between two steps, and resumes from them.

    `started` is the start of the training, as `time.perf_counter`.
    """

    def __init__(self, run: Run, parts: Parts, started: float) -> None:
        self._run, self._parts, self._started = run, parts, started
        interval, self._episodes = run.config.checkpoint, run.config.learn.episodes
        self.checkpoints = Checkpoints(run.folder, interval.every * self._episodes, interval.seconds)
        # Episode of the newest checkpoint; None without one.
        self._newest: int | None = None

    @property
    def seconds(self) -> float:
        """Training time so far, in all processes."""
        return time.perf_counter() - self._started

    def write(self) -> None:
        """Write a checkpoint; on a full disk the training continues without it.

        Raises:
            DivergedError: a loss or a weight is not finite. Earlier checkpoints are kept.
        """
        training, history = self._parts.training, self._parts.history
        training.check_finite()
        about = About(
            config_hash=self._run.config_hash,
            computed=self._parts.computed,
            episode=training.episode,
            episodes=self._episodes,
            steps=training.steps,
            seconds=self.seconds,
        )
        curve = np.frombuffer(to_csv(history.rows).encode(), dtype=np.uint8)
        tensors: dict[str, Tensor] = {
            **add_prefix("training", training.state_dict()),
            **add_prefix("best", {key: value.cpu() for key, value in history.network.state_dict().items()}),
            "curve": torch.from_numpy(curve.copy()),
            "starts": self._parts.starts.get_state(),
        }
        try:
            self.checkpoints.write(tensors, about)
            self._newest = training.episode
        except OSError as error:
            console.say(f"no checkpoint at episode {training.episode}: {error.strerror or error}")
            self.checkpoints.begin(training.episode)

    def resume(self, in_a_grid: bool = False) -> None:
        """Restore the training from the newest intact checkpoint of this run, if there is one.

        Damaged checkpoints are reported and deleted. After a checkpoint of other arithmetic the run would not
        end with the same bits: it is refused, or starts over in a grid, where nobody may be there to choose.
        """
        found, damaged = self.checkpoints.read(self._run.config_hash)
        for path, reason in damaged.items():
            then = "the other checkpoint is used" if found else "the run starts over"
            console.say(f"checkpoint: {path} {reason}; {then}")
            remove(path)
        if found is None:
            return
        about, tensors = found
        folder = self.checkpoints.folder
        if about.computed != self._parts.computed:
            differs = f"was computed by {about.computed}, and here it would be {self._parts.computed}"
            if in_a_grid:
                console.say(f"{folder}, episode {about.episode}, {differs}; the run starts over")
                self.checkpoints.remove()
                return
            raise ConfigError(
                f"output: {folder}, episode {about.episode}, {differs}; allowed: the same machine, device=, "
                f"learn.precision= and learn.backend=; or delete {folder} to start over"
            )
        try:
            self._parts.training.load_state_dict(strip_prefix("training", tensors))
            rows = bytes(tensors["curve"].numpy()).decode()
            self._parts.history.restore(rows, strip_prefix("best", tensors), self._parts.evaluate)
            self._parts.starts.set_state(tensors["starts"])
        except (KeyError, ValueError, IndexError, TypeError, RuntimeError, csv.Error) as error:
            raise ConfigError(
                f"output: {folder} was not written by this program ({type(error).__name__}); "
                f"delete {folder} to start over"
            ) from None
        self._started -= about.seconds
        self._newest = about.episode
        self.checkpoints.begin(about.episode)
        console.say(f"resuming from the checkpoint at episode {about.episode} of {about.episodes}")

    def stop(self) -> str:
        """Write a checkpoint; return a message that says where the training stopped and how to resume it."""
        self.write()
        then = "start over" if self._newest is None else f"resume from episode {self._newest}"
        at = self._parts.training.episode
        return f"stopped at episode {at} of {self._episodes}; run the same command again to {then}"

    def describe_divergence(self, error: DivergedError) -> str:
        """Return a message that says how the training diverged and which checkpoint is kept."""
        kept = "" if self._newest is None else f"; the checkpoint of episode {self._newest} is kept"
        return (
            f"learn: {error}, at episode {self._parts.training.episode} of {self._run.folder}{kept}; "
            "try a smaller learn.lr or learn.reward_scale, or learn.loss=huber"
        )
