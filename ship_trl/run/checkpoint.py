"""Checkpoints of a training: two safetensors files, written in turn.

The header names the run and holds a digest of the contents, because a truncated or corrupted file may still
have an intact header.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from safetensors import SafetensorError, safe_open

from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as
from ship_trl.files.disk import atomic_write, write_tensors

if TYPE_CHECKING:
    from torch import Tensor

FOLDER = "checkpoint"
# Key of our entry in the safetensors header.
HEADER_KEY = "ship_trl"


class CheckpointError(Exception):
    """A damaged checkpoint; the message says what is wrong with it."""


@dataclass(frozen=True)
class About:
    """The header of a checkpoint: its run, how it was computed, and how far the training was.

    With another arithmetic than `computed` (`Parts.computed`) the resumed run would have other bits.
    """

    config_hash: str
    computed: str
    episode: int
    episodes: int
    steps: int
    seconds: float


class Checkpoints:
    """The checkpoints in a run's folder, `checkpoint/1.safetensors` and `2.safetensors`.

    Between two there are at least `every` episodes, at least one, and `seconds`.
    """

    def __init__(self, run: Path, every: float = 1.0, seconds: float = 0.0) -> None:
        self.folder = run / FOLDER
        self._paths = [self.folder / f"{number}.safetensors" for number in (1, 2)]
        self._every, self._seconds = every, seconds
        self.begin(0)

    def begin(self, episode: int) -> None:
        """Restart the wait for the next checkpoint, after `episode` episodes."""
        self._written_at, self._episode = time.monotonic(), episode

    def due(self, episode: int) -> bool:
        """Return whether a checkpoint is due after `episode` episodes."""
        episodes, seconds = episode - self._episode, time.monotonic() - self._written_at
        return episodes >= max(1, self._every) and seconds >= self._seconds

    def write(self, tensors: Mapping[str, Tensor], about: About) -> None:
        """Replace the older of the two checkpoints.

        Raises:
            MemoryError: two copies of the tensors do not fit into memory.
            OSError: the disk is full, or the folder is not writable.
        """
        self.folder.mkdir(exist_ok=True)
        tensors = {name: value.contiguous() for name, value in tensors.items()}
        header = json.dumps(asdict(about) | {"digest": digest(tensors, about)})
        with atomic_write(min(self._paths, key=written_at)) as draft:
            write_tensors(draft, tensors, {HEADER_KEY: header})
        self.begin(about.episode)

    def read(self, config_hash: str) -> tuple[tuple[About, dict[str, Tensor]] | None, dict[Path, str]]:
        """Return the newest intact checkpoint of a run or None, and what is wrong with damaged files."""
        intact, damaged = [], {}
        for path in filter(Path.exists, self._paths):
            try:
                about, tensors = read(path)
            except CheckpointError as error:
                damaged[path] = str(error)
            else:
                intact += [(about, tensors)] if about.config_hash == config_hash else []
        return max(intact, key=lambda one: one[0].steps, default=None), damaged

    def remove(self) -> None:
        """Delete the checkpoints, because the run is finished or starts over."""
        shutil.rmtree(self.folder, ignore_errors=True)


def read_hashes(run: Path) -> set[str]:
    """Return the config hashes of a run's checkpoints, "" for unreadable ones; torch is not needed."""
    found = set()
    for path in (run / FOLDER).glob("*.safetensors"):
        try:
            with safe_open(path, framework="numpy") as file:
                found.add(str(json.loads(file.metadata()[HEADER_KEY])["config_hash"]))
        except (SafetensorError, OSError, ValueError, RecursionError, LookupError, TypeError):
            found.add("")
    return found


def written_at(path: Path) -> int:
    """Return when a file was written, in ns; 0 if it is missing."""
    return path.stat().st_mtime_ns if path.exists() else 0


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
    import torch

    found = hashlib.sha256(json.dumps(asdict(about), sort_keys=True).encode())
    for name in sorted(tensors):
        value = tensors[name]
        found.update(f"{name} {value.dtype} {tuple(value.shape)}".encode())
        found.update(value.reshape(-1).view(torch.uint8).numpy().data)
    return found.hexdigest()
