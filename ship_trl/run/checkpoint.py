"""Checkpoints of a training: all that decides how it goes on, in two generations.

A checkpoint is a safetensors file, so that nothing is unpickled; its header says of which run it is, and
holds a digest of everything in it, for a file may be cut short or have bits turned over where no header
tells. Headers are read without torch.
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
# The name of the header's entry.
ENTRY = "ship_trl"


class CheckpointError(Exception):
    """A checkpoint that is damaged; its text says how, in a few words."""


@dataclass(frozen=True)
class About:
    """What a checkpoint says of itself.

    `config_hash` tells of which run it is; `computed` by what arithmetic (`Parts.computed`), for with another
    it would not go on with the same bits. `episode` of `episodes` are sailed, in
    `steps` of the environment and `seconds`.
    """

    config_hash: str
    computed: str
    episode: int
    episodes: int
    steps: int
    seconds: float


KINDS: dict[str, tuple[type, ...]] = {
    "config_hash": (str,),
    "computed": (str,),
    "episode": (int,),
    "episodes": (int,),
    "steps": (int,),
    "seconds": (int, float),
}


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint that was read: what it says of itself, and its tensors by dotted names."""

    about: About
    tensors: dict[str, Tensor]


class Checkpoints:
    """The checkpoints of one run, `<run>/checkpoint/1.safetensors` and `2.safetensors`.

    Args:
        run: the run's folder.
        every: so many episodes between two, and one at least.
        seconds: at least so many between two.
        clock: tells the time in seconds; it never goes back.
    """

    def __init__(
        self, run: Path, every: float = 1.0, seconds: float = 0.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.folder = run / FOLDER
        self._every, self._seconds, self._clock = every, seconds, clock
        self._said, self._episode = clock(), 0

    def begin(self, episode: int) -> None:
        """Count from here on."""
        self._said, self._episode = self._clock(), episode

    def due(self, episode: int) -> bool:
        """Whether it is time to write one after so many episodes."""
        sailed = episode - self._episode
        return sailed >= max(1, self._every) and self._clock() - self._said >= self._seconds

    def write(self, tensors: Mapping[str, Tensor], about: About) -> None:
        """Write a checkpoint in the place of the older one of the two.

        Raises:
            MemoryError: there is no room for two copies of the tensors.
            OSError: the disk is full, or the folder cannot be written.
        """
        self.folder.mkdir(exist_ok=True)
        tensors = {name: value.contiguous() for name, value in tensors.items()}
        header = json.dumps(asdict(about) | {"digest": digest(tensors, about)})
        with replacing(self._oldest()) as draft:
            write_tensors(draft, tensors, {ENTRY: header})
        self.begin(about.episode)

    def read(self, config_hash: str) -> tuple[Checkpoint | None, dict[Path, str]]:
        """Read a run's newest whole checkpoint, None without one; say of each damaged one what is wrong.

        One whose header cannot be read may be the newest, so that it is named too.
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
        """Say what the newest checkpoint with a whole header is, None without one; reads little of it."""
        for path in self._newest_first():
            try:
                return read_about(path)
            except CheckpointError:
                continue
        return None

    def begin_run(self, config_hash: str) -> None:
        """Make their folder, and note whose they will be: a damaged one does not tell.

        Raises:
            OSError: it cannot be written.
        """
        self.folder.mkdir(exist_ok=True)
        with replacing(self.folder / OWNER) as draft:
            draft.write_text(config_hash)

    def of_another(self, config_hash: str) -> bool:
        """Whether there are checkpoints, and another run has noted that they are its own."""
        try:
            owner = read_file(self.folder / OWNER, most=MAX_NAME_LENGTH).decode()
        except (OSError, ValueError):
            return False
        return owner != config_hash and bool(self._newest_first())

    def remove(self) -> None:
        """Take them away: the run is finished, or begins anew."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _files(self) -> list[Path]:
        return [self.folder / f"{number}.safetensors" for number in (1, 2)]

    def _newest_first(self) -> list[Path]:
        there = (path for path in self._files() if path.exists() or path.is_symlink())
        return sorted(there, key=steps_of, reverse=True)

    def _oldest(self) -> Path:
        return min(self._files(), key=steps_of)


def steps_of(path: Path) -> int:
    """Environment steps after which a checkpoint was written; -1 without one that says so."""
    try:
        return read_about(path).steps
    except CheckpointError:
        return -1


def read_about(path: Path) -> About:
    """Read what a checkpoint says of itself.

    Raises:
        CheckpointError: there is none, or it is damaged.
    """
    with opened(path, "numpy") as file:
        return about_of(header_of(file))


def read(path: Path) -> Checkpoint:
    """Read a whole checkpoint.

    Raises:
        CheckpointError: there is none, or it is damaged.
    """
    with opened(path, "pt") as file:
        header = header_of(file)
        about = about_of(header)
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    if header.get("digest") != digest(tensors, about):
        raise CheckpointError("is damaged")
    return Checkpoint(about, tensors)


def header_of(file: Any) -> dict[str, Any]:
    """Give the header's entry of an opened file.

    Raises:
        CheckpointError: it is no checkpoint's.
    """
    try:
        values = json.loads((file.metadata() or {}).get(ENTRY, ""))
    except (ValueError, RecursionError):
        raise CheckpointError("is no checkpoint") from None
    if not isinstance(values, dict):
        raise CheckpointError("is no checkpoint")
    return values


def about_of(header: dict[str, Any]) -> About:
    """Give what a header says.

    Raises:
        CheckpointError: an entry is missing, or of another kind.
    """
    values: dict[str, Any] = {name: header.get(name) for name in KINDS}
    for name, kinds in KINDS.items():
        if type(values[name]) not in kinds:
            raise CheckpointError(f"has no right {name} in its header")
    return About(**values)


@contextmanager
def opened(path: Path, framework: str) -> Iterator[Any]:
    """Open a safetensors file.

    Raises:
        CheckpointError: there is none, or it is cut short.
    """
    if not path.is_file() or path.is_symlink():
        raise CheckpointError("is no file")
    try:
        with safe_open(path, framework=framework) as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"cannot be read ({' '.join(str(error).split())})") from None


def digest(tensors: Mapping[str, Tensor], about: About) -> str:
    """Digest all that a checkpoint holds."""
    import torch

    found = hashlib.sha256(json.dumps(asdict(about), sort_keys=True).encode())
    for name in sorted(tensors):
        value = tensors[name]
        found.update(f"{name} {value.dtype} {tuple(value.shape)}".encode())
        found.update(value.reshape(-1).view(torch.uint8).numpy().data)
    return found.hexdigest()
