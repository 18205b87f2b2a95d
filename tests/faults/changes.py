"""Act before a step of a command that changes its folder: Python's audit hooks announce those."""

import errno
import itertools
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

CHANGES = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.chmod", "os.truncate"}
# What needs room on the disk.
NEEDS_ROOM = {"open", "os.mkdir", "os.link"}
WRITES = os.O_WRONLY | os.O_RDWR


def before_changes(act: Callable[[int, str, str], None]) -> None:
    """Call `act` with number (from 0), event and path of each change of this process in its folder."""
    folder, numbers = f"{Path.cwd()}/", itertools.count()

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event not in CHANGES or not isinstance(arguments[0], str | os.PathLike):
            return
        if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & WRITES):
            return
        path = str(Path.cwd() / os.fspath(arguments[0]))
        if path.startswith(folder):
            act(next(numbers), event, path)

    sys.addaudithook(hook)


def die_at(step: int) -> Callable[[], None]:
    """Kill the child before its step of that number."""

    def act(number: int, event: str, path: str) -> None:
        if number == step:
            os.kill(os.getpid(), signal.SIGKILL)

    return lambda: before_changes(act)


def full_at(step: int) -> Callable[[], None]:
    """Let no file or folder be made any more from a step on, as if the disk were full."""

    def act(number: int, event: str, path: str) -> None:
        if number >= step and event in NEEDS_ROOM:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)

    return lambda: before_changes(act)
