"""Checkpoints of a training: everything that is needed to resume it, in two alternating files.

A checkpoint is a safetensors file, so that nothing is unpickled. Its header names the run and holds a digest
of the contents, because a truncated or corrupted file may still have an intact header. Headers are read
without torch.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from safetensors import SafetensorError, safe_open

from ship_trl.config.paths import MAX_NAME_LENGTH
from ship_trl.files.disk import read_file, replacing, write_tensors

if TYPE_CHECKING:
    from torch import Tensor

FOLDER, OWNER = "checkpoint", "config_hash"
# Key of our entry in the safetensors header.
HEADER_KEY = "ship_trl"


class CheckpointError(Exception):
    """A damaged checkpoint; the message says how, in a few words."""


@dataclass(frozen=True)
class About:
    """The header of a checkpoint.

    Attributes:
        config_hash: which run it belongs to.
        computed: the arithmetic that computed it (`Parts.computed`). Under another the run would not be
            resumed with the same bits.
        episode: how many training episodes are finished.
        episodes: how many the run has.
        steps: environment steps so far.
        seconds: training time so far.
    """

    config_hash: str
    computed: str
    episode: int
    episodes: int
    steps: int
    seconds: float


HEADER_TYPES: dict[str, tuple[type, ...]] = {
    "config_hash": (str,),
    "computed": (str,),
    "episode": (int,),
    "episodes": (int,),
    "steps": (int,),
    "seconds": (int, float),
}


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint as read: its header, and its tensors by dotted names."""

    about: About
    tensors: dict[str, Tensor]


class Checkpoints:
    """The checkpoints of one run, `<run>/checkpoint/1.safetensors` and `2.safetensors`.

    Args:
        run: the run's folder.
        every: minimum number of episodes between two checkpoints; below 1 it counts as 1.
        seconds: minimum time between two checkpoints.
        clock: returns monotonic time in seconds.
    """

    def __init__(
        self, run: Path, every: float = 1.0, seconds: float = 0.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.folder = run / FOLDER
        self._every, self._seconds, self._clock = every, seconds, clock
        self._written_at, self._episode = clock(), 0

    def begin(self, episode: int) -> None:
        """Start the wait for the next checkpoint at this episode."""
        self._written_at, self._episode = self._clock(), episode

    def due(self, episode: int) -> bool:
        """Whether a checkpoint is due after `episode` episodes."""
        episodes, seconds = episode - self._episode, self._clock() - self._written_at
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
        with replacing(self._oldest()) as draft:
            write_tensors(draft, tensors, {HEADER_KEY: header})
        self.begin(about.episode)

    def read(self, config_hash: str) -> tuple[Checkpoint | None, dict[Path, str]]:
        """Read the newest intact checkpoint of a run.

        Returns:
            The checkpoint, or None, and what is wrong with each damaged file. A file with an unreadable
            header counts as damaged, because it may be the newest.
        """
        damaged: dict[Path, str] = {}
        newest: Checkpoint | None = None
        for path in self._newest_first():
            try:
                if newest is None:
                    found = read(path)
                    newest = found if found.about.config_hash == config_hash else None
                else:
                    read_about(path)
            except CheckpointError as error:
                damaged[path] = str(error)
        return newest, damaged

    def about(self) -> About | None:
        """Return the newest readable header, or None; the tensors are not read."""
        for path in self._newest_first():
            try:
                return read_about(path)
            except CheckpointError:
                continue
        return None

    def begin_run(self, config_hash: str) -> None:
        """Create the folder and write down which run owns it, in case its checkpoints get damaged.

        Raises:
            OSError: the folder is not writable.
        """
        self.folder.mkdir(exist_ok=True)
        with replacing(self.folder / OWNER) as draft:
            draft.write_text(config_hash)

    def has_other_owner(self, config_hash: str) -> bool:
        """Whether there are checkpoints, and the folder is owned by another run."""
        try:
            owner = read_file(self.folder / OWNER, most=MAX_NAME_LENGTH).decode()
        except (OSError, ValueError):
            return False
        return owner != config_hash and bool(self._newest_first())

    def remove(self) -> None:
        """Delete the checkpoints, because the run is finished or starts over."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _files(self) -> list[Path]:
        return [self.folder / f"{number}.safetensors" for number in (1, 2)]

    def _newest_first(self) -> list[Path]:
        existing = (path for path in self._files() if path.exists() or path.is_symlink())
        return sorted(existing, key=read_steps, reverse=True)

    def _oldest(self) -> Path:
        return min(self._files(), key=read_steps)


def read_steps(path: Path) -> int:
    """Return the environment steps in a checkpoint's header, or -1 if it is unreadable."""
    try:
        return read_about(path).steps
    except CheckpointError:
        return -1


def read_about(path: Path) -> About:
    """Read the header of a checkpoint.

    Raises:
        CheckpointError: it is missing or damaged.
    """
    with opened(path, "numpy") as file:
        return parse_about(parse_header(file))


def read(path: Path) -> Checkpoint:
    """Read a checkpoint and compare it with its digest.

    Raises:
        CheckpointError: it is missing or damaged.
    """
    with opened(path, "pt") as file:
        header = parse_header(file)
        about = parse_about(header)
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    if header.get("digest") != digest(tensors, about):
        raise CheckpointError("is damaged")
    return Checkpoint(about, tensors)


def parse_header(file: Any) -> dict[str, Any]:
    """Return our entry of an open file's header.

    Raises:
        CheckpointError: the file is no checkpoint.
    """
    try:
        values = json.loads((file.metadata() or {}).get(HEADER_KEY, ""))
    except (ValueError, RecursionError):
        raise CheckpointError("is no checkpoint") from None
    if not isinstance(values, dict):
        raise CheckpointError("is no checkpoint")
    return values


def parse_about(header: dict[str, Any]) -> About:
    """Check the types of a header's values.

    Raises:
        CheckpointError: a value is missing or has another type.
    """
    values: dict[str, Any] = {name: header.get(name) for name in HEADER_TYPES}
    for name, types in HEADER_TYPES.items():
        if type(values[name]) not in types:
            raise CheckpointError(f"has no right {name} in its header")
    return About(**values)


@contextmanager
def opened(path: Path, framework: str) -> Iterator[Any]:
    """Open a safetensors file.

    Raises:
        CheckpointError: it is missing, a link, or truncated.
    """
    if not path.is_file() or path.is_symlink():
        raise CheckpointError("is no file")
    try:
        with safe_open(path, framework=framework) as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"cannot be read ({' '.join(str(error).split())})") from None


def digest(tensors: Mapping[str, Tensor], about: About) -> str:
    """Return the SHA-256 of everything in a checkpoint."""
    import torch

    found = hashlib.sha256(json.dumps(asdict(about), sort_keys=True).encode())
    for name in sorted(tensors):
        value = tensors[name]
        found.update(f"{name} {value.dtype} {tuple(value.shape)}".encode())
        found.update(value.reshape(-1).view(torch.uint8).numpy().data)
    return found.hexdigest()
