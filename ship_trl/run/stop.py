"""Ctrl-C and SIGTERM: a training ends between two steps, where it can be written down. No torch."""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import Any, NoReturn

# Seconds that the runs of a grid have; a step of the environment and a checkpoint take a tenth.
TIME_TO_STOP = 2.0


class StoppedError(KeyboardInterrupt):
    """A training that was asked to stop and did; its text says where it stands and how to go on."""

    def __init__(self, text: str, number: signal.Signals) -> None:
        super().__init__(text)
        self.text, self.number = text, number

    def __reduce__(self) -> tuple[type[StoppedError], tuple[str, signal.Signals]]:
        """Let a process of a pool send it: by itself it would be made of its text alone."""
        return StoppedError, (self.text, self.number)


class Stop:
    """A context in which the first Ctrl-C or SIGTERM only sets `asked`; a second Ctrl-C acts at once.

    SIGTERM is what Slurm, Kubernetes and a launcher's end send. Outside of a process's main thread it
    changes nothing: signals arrive there alone.
    """

    def __init__(self) -> None:
        self.asked: signal.Signals | None = None
        self._interrupts = 0
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Stop:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                # One that is ignored stays so, as of a process in the background; None was set by no Python.
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._before[number] = signal.signal(number, self._ask)
        return self

    def _ask(self, number: int, _: FrameType | None) -> None:
        # A shell's Ctrl-C reaches this process and its launcher, which then asks once more by SIGTERM.
        self._interrupts += number == signal.SIGINT
        if self._interrupts > 1:
            raise KeyboardInterrupt
        self.asked = self.asked or signal.Signals(number)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)


class TerminatedError(BaseException):
    """SIGTERM, where what a process has started is to be ended before it ends."""


def unwind_at_sigterm() -> None:
    """Raise `TerminatedError` at the first SIGTERM; further ones are ignored."""

    def unwind(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise TerminatedError

    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, unwind)


def heed_sigterm() -> None:
    """End by SIGTERM where nothing else is done at it, even as the first process of a container.

    The system does not end that one by a signal which it does not handle.
    """
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, lambda number, _: die_of(signal.Signals(number)))


def die_of(number: signal.Signals) -> NoReturn:
    """End this process by a signal, as one that does not handle it ends, and take up no other work."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)
    # The first process of a container is not killed by its own signals.
    os._exit(128 + number)
