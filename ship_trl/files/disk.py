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

# The largest file that is read at once; a curve of ten million episodes is as large.
MAX_FILE_BYTES = 1 << 30
# Errors of a disk that is full, broken or over a quota; they may name no file.
DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}


def read_file(path: Path, most: int = MAX_FILE_BYTES) -> bytes:
    """Read a file; raise OSError if it has more than `most` bytes."""
    if path.stat().st_size > most:
        raise OSError(errno.EFBIG, f"is larger than {most} bytes", str(path))
    return path.read_bytes()


def remove(path: Path) -> None:
    """Remove a file, a link, or a folder with its content."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def read_json(path: Path, most: int = MAX_FILE_BYTES) -> Any:
    """Read a JSON file, or raise an OSError as `read_file` does, or a ValueError."""
    try:
        return json.loads(read_file(path, most))
    except RecursionError:
        raise ValueError("nested too deep") from None


@contextmanager
def writing(path: Path, draft: Path | None = None) -> Iterator[None]:
    """Name `path` in an `OSError` that names no file, as on a full disk, or only the draft."""
    try:
        yield
    except OSError as error:
        # An error without a number would lose its text if it named a file.
        if error.errno is not None and error.filename in (None, draft, str(draft)):
            error.filename = str(path)
        raise


def sync(path: Path) -> None:
    """Flush a file or a folder's names to the disk, so that they survive a power cut."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Write atomically: yield the path of a draft beside `path`, and rename it to `path` at the end.

    The folder is made if there is none.
    A reader sees the old file or the whole new one; after an error only the old one is left.
    """
    # The name cannot be guessed: a link put there in advance would be written through.
    draft = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        with writing(path, draft):
            path.parent.mkdir(parents=True, exist_ok=True)
            yield draft
            # Some writers make files that only the owner can read.
            draft.chmod(0o644)
            sync(draft)
            draft.replace(path)
            sync(path.parent)
    finally:
        draft.unlink(missing_ok=True)


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, str]) -> None:
    """Write contiguous tensors as a safetensors file."""
    from safetensors.torch import save

    # `save_file` raises no OSError on a full disk, and leaves a draft of its own if killed.
    path.write_bytes(save(dict(tensors), dict(header)))
