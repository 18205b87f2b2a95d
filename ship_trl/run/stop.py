"""Ctrl-C and SIGTERM: stop a training between two steps, where a checkpoint can be written. No torch."""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import Any, NoReturn

# Seconds that the runs of a grid get to stop; a step and a checkpoint take a tenth of that.
TIME_TO_STOP = 2.0


class StoppedError(KeyboardInterrupt):
    """A training that was asked to stop and did; the message says where, and how to resume."""

    def __init__(self, text: str, number: signal.Signals) -> None:
        super().__init__(text)
        self.text, self.number = text, number

    def __reduce__(self) -> tuple[type[StoppedError], tuple[str, signal.Signals]]:
        """Keep both arguments when a pool process sends the error."""
        return StoppedError, (self.text, self.number)


class Stop:
    """A context in which the first Ctrl-C or SIGTERM only sets `asked`; a second Ctrl-C acts at once.

    SIGTERM is sent by Slurm, by Kubernetes, and when a launcher ends. Outside the main thread the context has
    no effect, because signals arrive only there.
    """

    def __init__(self) -> None:
        self.asked: signal.Signals | None = None
        self._interrupts = 0
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Stop:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                # An ignored signal stays ignored, as in a background process. None: not set from Python.
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._before[number] = signal.signal(number, self._ask)
        return self

    def _ask(self, number: int, _: FrameType | None) -> None:
        # Ctrl-C in a shell reaches this process and its launcher, which then also sends SIGTERM.
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
    """SIGTERM in a process that must end its children before it ends."""


def unwind_at_sigterm() -> None:
    """Raise `TerminatedError` at the first SIGTERM; further ones are ignored."""

    def unwind(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise TerminatedError

    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, unwind)


def heed_sigterm() -> None:
    """End at SIGTERM if there is no other handler, even as the first process of a container.

    The system does not end that process by a signal without a handler.
    """
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, lambda number, _: die_of(signal.Signals(number)))


def die_of(number: signal.Signals) -> NoReturn:
    """End this process by a signal as if it had no handler, at once."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)
    # Only reached by the first process of a container, which its own signals do not kill.
    os._exit(128 + number)
