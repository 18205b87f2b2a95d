"""Where the shipped YAML lies, and how files that matter are read and written."""

from __future__ import annotations

import errno
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

# Bytes of any file that is read whole, at most: a curve of ten million episodes.
LARGEST = 1 << 30
# The disk is full, a quota or a limit is reached, or it is broken; an error of writing may name no file.
DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}


def links(folder: Path, below: Path) -> list[Path]:
    """List what is a link of a folder and those that it lies in, up to `below`, which may be one itself."""
    return [place for place in (folder, *folder.parents) if below in place.parents and place.is_symlink()]


def read_file(path: Path, most: int = LARGEST) -> bytes:
    """Read a file of at most so many bytes.

    Raises:
        OSError: it is not there, or larger, or is a folder, a pipe or a device: to read one of those might
            never end.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "is no file", str(path))
    if path.stat().st_size > most:
        raise OSError(errno.EFBIG, f"is larger than {most} bytes", str(path))
    return path.read_bytes()


def remove(path: Path) -> None:
    """Take away what is there: a file, a link, or a folder with all in it."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        OSError: as `read_file`.
        ValueError: it is not JSON, or lists in lists lie too deep.
    """
    try:
        return json.loads(read_file(path))
    except RecursionError:
        raise ValueError("nested too deep") from None


@contextmanager
def writing(path: Path, draft: Path | None = None) -> Iterator[None]:
    """Name `path` in an `OSError` that names no file, as that of a full disk does, or names its draft."""
    try:
        yield
    except OSError as error:
        # One without a number has a text of its own, which a file name would hide.
        if error.errno is not None and error.filename in (None, draft, str(draft)):
            error.filename = str(path)
        raise


def sync(path: Path) -> None:
    """Wait until a file, or a folder's names, are on the disk: a power cut may else leave an empty file."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a neighbouring name to write to, then rename it over `path`.

    A reader sees the old file or the whole new one; after an error only the old one is left.
    """
    # A name that nobody can guess: a link that waits under it would be written through.
    draft = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        with writing(path, draft):
            yield draft
            # Some writers make files that only their owner may read; results are for the group too.
            draft.chmod(0o644)
            sync(draft)
            draft.replace(path)
            sync(path.parent)
    finally:
        draft.unlink(missing_ok=True)


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, str]) -> None:
    """Write a safetensors file, to a name that `replacing` gives; the tensors must be contiguous.

    Raises:
        MemoryError: there is no room for two copies of the tensors.
        OSError: the disk is full, or the folder cannot be written.
    """
    import numpy as np
    from safetensors.torch import save

    # safetensors makes both copies in Rust, which ends the process where it finds no memory: so Python asks
    # first, and what it gives back is there for them.
    np.empty(2 * sum(value.nbytes for value in tensors.values()) + (1 << 20), np.uint8)
    # Not `save_file`: its error of a full disk is no OSError, and it leaves a draft of its own if killed.
    path.write_bytes(save(dict(tensors), dict(header)))
