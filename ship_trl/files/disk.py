"""Reading files of limited size, and atomic writes."""

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

# Bytes of a file that is read at once: a curve of ten million episodes.
MAX_FILE_BYTES = 1 << 30
# Errors of a disk that is full or broken, or of a quota; such an error may name no file.
DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}


def links(folder: Path, below: Path) -> list[Path]:
    """List the links among a folder and its parents inside `below`."""
    return [place for place in (folder, *folder.parents) if below in place.parents and place.is_symlink()]


def read_file(path: Path, most: int = MAX_FILE_BYTES) -> bytes:
    """Read a file of at most `most` bytes.

    Raises:
        OSError: it is missing or larger, or is a folder, a pipe or a device, whose reading might never end.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "is no file", str(path))
    if path.stat().st_size > most:
        raise OSError(errno.EFBIG, f"is larger than {most} bytes", str(path))
    return path.read_bytes()


def remove(path: Path) -> None:
    """Remove a file, a link, or a folder with its content."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        OSError: as `read_file`.
        ValueError: it is not JSON, or nested too deeply.
    """
    try:
        return json.loads(read_file(path))
    except RecursionError:
        raise ValueError("nested too deep") from None


@contextmanager
def writing(path: Path, draft: Path | None = None) -> Iterator[None]:
    """Name `path` in an `OSError` that names no file, as on a full disk, or only its draft."""
    try:
        yield
    except OSError as error:
        # The text of an error without a number would be hidden by a file name.
        if error.errno is not None and error.filename in (None, draft, str(draft)):
            error.filename = str(path)
        raise


def sync(path: Path) -> None:
    """Flush a file or a folder's names to the disk: after a power cut the file might else be empty."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Write atomically: yield the path of a draft beside `path`, and rename it over `path` at the end.

    A reader sees the old file or the whole new one; after an error only the old one is left.
    """
    # A name that cannot be guessed: a link put there in advance would be written through.
    draft = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        with writing(path, draft):
            yield draft
            # Some writers make files that only their owner may read.
            draft.chmod(0o644)
            sync(draft)
            draft.replace(path)
            sync(path.parent)
    finally:
        draft.unlink(missing_ok=True)


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, str]) -> None:
    """Write a safetensors file to a draft of `atomic_write`; the tensors must be contiguous.

    Raises:
        MemoryError: there is no room for two copies of the tensors.
        OSError: the disk is full, or the folder cannot be written.
    """
    import numpy as np
    from safetensors.torch import save

    # safetensors makes two copies in Rust, which aborts the process where memory is short. So Python
    # allocates as much first, and frees it again.
    np.empty(2 * sum(value.nbytes for value in tensors.values()) + (1 << 20), np.uint8)
    # Not `save_file`: on a full disk it raises no OSError, and it leaves a draft of its own if killed.
    path.write_bytes(save(dict(tensors), dict(header)))
