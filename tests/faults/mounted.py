"""File systems of our own, in a process of their own: small ones, and some that cannot be written. Linux."""

import ctypes
import os
import tempfile
import traceback
from collections.abc import Callable
from functools import cache
from pathlib import Path

CLONE_NEWNS, CLONE_NEWUSER = 0x20000, 0x10000000
MS_RDONLY, MS_REMOUNT, MS_REC, MS_PRIVATE = 1, 32, 16384, 1 << 18
ROOM = 2 << 30


def apart(work: Callable[[], str]) -> str:
    """Run `work` in a child whose mounts nobody else sees and which end with it; returns what it gives."""
    with tempfile.TemporaryFile() as said:
        pid = os.fork()
        if pid == 0:
            try:
                own_mounts()
                text = work()
            except BaseException:
                text = traceback.format_exc()
            os.write(said.fileno(), text.encode())
            os._exit(0)
        _, status = os.waitpid(pid, 0)
        said.seek(0)
        return said.read().decode() if status == 0 else f"the trial itself ended with {status}"


def own_mounts() -> None:
    """Leave the mounts of the machine; who is not root becomes root of a namespace first."""
    user, group = os.getuid(), os.getgid()
    call("unshare", CLONE_NEWNS | (CLONE_NEWUSER if user else 0))
    if user:
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    call("mount", b"none", b"/", None, MS_REC | MS_PRIVATE, None)


def mount(place: Path, size: int = ROOM, again: bool = False, read_only: bool = False) -> None:
    """Mount a file system of so many bytes in memory, or change the one that is there."""
    flags = (MS_REMOUNT if again else 0) | (MS_RDONLY if read_only else 0)
    call("mount", b"none", str(place).encode(), b"tmpfs", flags, f"size={size}".encode())


def call(name: str, *arguments: object) -> None:
    """Call the C library, and raise what it complains of."""
    if getattr(ctypes.CDLL(None, use_errno=True), name)(*arguments) != 0:
        raise OSError(ctypes.get_errno(), f"{name}: {os.strerror(ctypes.get_errno())}")


@cache
def possible() -> bool:
    """Whether this machine lets us mount."""

    with tempfile.TemporaryDirectory() as folder:

        def work() -> str:
            mount(Path(folder))
            return ""

        return apart(work) == ""
