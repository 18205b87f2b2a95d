"""Checkpoints of a training: written between two steps, and read to resume it.

Two safetensors files are written in turn. The header names the run and holds a digest of the contents,
because a truncated or corrupted file may still have an intact header.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as
from ship_trl.files.disk import atomic_write, remove, write_tensors
from ship_trl.learn.algorithm import add_prefix, strip_prefix
from ship_trl.run import console
from ship_trl.run.header import HEADER_KEY, About
from ship_trl.run.plan import CHECKPOINTS, LAST_CHECKPOINT, Run
from ship_trl.run.setup import Parts

NAMES = ("1.safetensors", "2.safetensors")


class CheckpointError(Exception):
    """A damaged checkpoint; the message says what is wrong with it."""


class Checkpoints:
    """Writes checkpoints of a training between two steps, and resumes from them.

    `started` is the start of the training, as `time.perf_counter`.
    """

    def __init__(self, run: Run, parts: Parts, started: float) -> None:
        self._run, self._parts, self._started = run, parts, started
        self._folder, self._episodes = run.folder / CHECKPOINTS, run.config.learn.episodes
        # The file to write next, and the episode of the newest checkpoint; None without one.
        self._next = NAMES[0]
        self._newest: int | None = None
        self._wait()

    @property
    def seconds(self) -> float:
        """Training time so far, in all processes."""
        return time.perf_counter() - self._started

    @property
    def kept(self) -> str:
        """What a message adds of the newest checkpoint."""
        return "" if self._newest is None else f"; the checkpoint of episode {self._newest} is kept"

    def _wait(self) -> None:
        """Begin to wait for the next checkpoint."""
        self._waits_since, self._waits_from = time.monotonic(), self._parts.training.episode

    @property
    def is_due(self) -> bool:
        """Whether enough episodes, at least one, and enough seconds have passed since the last one."""
        interval = self._run.config.checkpoint
        episodes = self._parts.training.episode - self._waits_from
        is_late = time.monotonic() - self._waits_since >= interval.seconds
        return is_late and episodes >= max(1, interval.every * self._episodes)

    def write(self) -> None:
        """Replace the older checkpoint; on a full disk the training continues without it.

        Raises:
            DivergedError: a loss or a weight is not finite. Earlier checkpoints are kept.
        """
        if self._save(self._folder / self._next):
            self._newest = self._parts.training.episode
            self._next = other(self._next)
        self._wait()

    def write_last(self) -> None:
        """Write the checkpoint from which the finished run can be extended, if it is to be kept.

        Raises:
            DivergedError: as in `write`.
        """
        if self._run.config.checkpoint.keep:
            self._save(self._run.folder / LAST_CHECKPOINT)

    def _save(self, path: Path) -> bool:
        """Write a checkpoint, and return whether there was room for it."""
        training, history, parts = self._parts.training, self._parts.history, self._parts
        training.check_finite()
        done = training.episode, self._episodes, training.steps, self.seconds
        rows = np.frombuffer(json.dumps(history.rows).encode(), dtype=np.uint8)
        tensors: dict[str, Tensor] = {
            **add_prefix("training", training.state_dict()),
            **add_prefix("best", {key: value.cpu() for key, value in history.network.state_dict().items()}),
            "rows": torch.from_numpy(rows.copy()),
            "starts": parts.starts.get_state(),
        }
        try:
            about = About(self._run.config_hash, parts.computed, *done, [*self._run.extended])
            write(path, tensors, about)
            return True
        except OSError as error:
            console.say(f"no checkpoint at episode {training.episode}: {error.strerror or error}")
            return False

    def resume(self, in_a_grid: bool = False) -> None:
        """Restore the training from the newest intact checkpoint of this run, if there is one.

        An extension without one begins with the last checkpoint of the run before, and never starts over.
        Damaged checkpoints are reported and deleted. After a checkpoint of other arithmetic the run would not
        end with the same bits: it is refused. It starts over with `overwrite=true`, or in a grid, where
        nobody may be there to choose.

        Raises:
            ConfigError: a checkpoint is of other arithmetic or another program, or that to extend is damaged.
        """
        run, is_extension = self._run, self._run.extends is not None
        paths = *(self._folder / name for name in NAMES), run.folder / LAST_CHECKPOINT
        found, damaged = read_newest(paths, run.config_hash, run.extends)
        if found is None and is_extension:
            raise ConfigError(f"extend: {run.folder / LAST_CHECKPOINT} is damaged; allowed: a whole one")
        for path, reason in damaged.items():
            then = "the other checkpoint is used" if found else "the run starts over"
            console.say(f"checkpoint: {path} {reason}; {then}")
            remove(path)
        if found is None:
            return
        path, about, tensors = found
        parts, place = self._parts, f"{path}, episode {about.episode},"
        if about.computed != parts.computed:
            over = "" if is_extension else "; or overwrite=true to start over"
            differs = f"was computed by {about.computed}, and here it would be {parts.computed}"
            if not is_extension and (in_a_grid or run.config.overwrite):
                console.say(f"{place} {differs}; the run starts over")
                return
            raise ConfigError(
                f"output: {place} {differs}; allowed: the same machine, device=, fast=, "
                f"learn.precision= and learn.backend={over}"
            )
        try:
            parts.training.load_state_dict(strip_prefix("training", tensors))
            parts.history.rows = json.loads(bytes(tensors["rows"].numpy()))
            parts.history.network.load_state_dict(strip_prefix("best", tensors))
            parts.starts.set_state(tensors["starts"])
        except (KeyError, ValueError, IndexError, TypeError, RuntimeError) as error:
            raise ConfigError(
                f"output: {self._folder} was not written by this program ({type(error).__name__}); "
                f"delete {self._folder} to start over"
            ) from None
        self._started -= about.seconds
        self._newest = about.episode
        self._next = other(path.name) if path.name in NAMES else NAMES[0]
        self._wait()
        if about.config_hash == run.config_hash:
            console.say(f"resuming from the checkpoint at episode {about.episode} of {about.episodes}")
        else:
            console.say(f"extending the run of {about.episodes} episodes to {self._episodes}")

    def stop(self) -> str:
        """Write a checkpoint; return a message that says where the training stopped and how to resume it."""
        self.write()
        then = "start over" if self._newest is None else f"resume from episode {self._newest}"
        at = f"episode {self._parts.training.episode} of {self._episodes}"
        return f"stopped at {at}; run the same command again to {then}"


def other(name: str) -> str:
    """Return the name of the other of the two files."""
    return NAMES[1 - NAMES.index(name)]


def write(path: Path, tensors: Mapping[str, Tensor], about: About) -> None:
    """Write a checkpoint, or raise an OSError."""
    tensors = {name: value.contiguous() for name, value in tensors.items()}
    header = json.dumps(asdict(about) | {"digest": digest(tensors, about)})
    with atomic_write(path) as draft:
        write_tensors(draft, tensors, {HEADER_KEY: header})


def read_newest(
    paths: Iterable[Path], config_hash: str, extends: str | None = None
) -> tuple[tuple[Path, About, dict[str, Tensor]] | None, dict[Path, str]]:
    """Return a run's newest intact checkpoint with its path, and what is wrong with damaged ones.

    The end of the run that it `extends` counts too.
    """
    intact, damaged = [], {}
    for path in filter(Path.exists, paths):
        try:
            about, tensors = read(path)
        except CheckpointError as error:
            damaged[path] = str(error)
        else:
            is_end = about.config_hash == extends and about.episode == about.episodes
            intact += [(path, about, tensors)] if is_end or about.config_hash == config_hash else []
    return max(intact, key=lambda one: one[1].steps, default=None), damaged


def read(path: Path) -> tuple[About, dict[str, Tensor]]:
    """Read a checkpoint; raise a `CheckpointError` if it is missing, truncated, or damaged by its digest."""
    try:
        with safe_open(path, framework="pt") as file:
            values = json.loads((file.metadata() or {}).get(HEADER_KEY, ""))
            about = read_as(About, values, from_json=True)
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError, RecursionError, ConfigError) as error:
        raise CheckpointError(f"cannot be read ({' '.join(str(error).split())})") from None
    if values.get("digest") != digest(tensors, about):
        raise CheckpointError("is damaged")
    return about, tensors


def digest(tensors: Mapping[str, Tensor], about: About) -> str:
    """Return the SHA-256 of everything in a checkpoint."""
    found = hashlib.sha256(json.dumps(asdict(about), sort_keys=True).encode())
    for name in sorted(tensors):
        value = tensors[name]
        found.update(f"{name} {value.dtype} {tuple(value.shape)}".encode())
        found.update(value.reshape(-1).view(torch.uint8).numpy().data)
    return found.hexdigest()
