"""Ctrl-C and SIGTERM: stop a training between two steps, where a checkpoint can be written. No torch."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import NoReturn

# Seconds that the runs of a grid get to stop; a step and a checkpoint take a tenth of it.
TIME_TO_STOP = 2.0


class StoppedError(KeyboardInterrupt):
    """A training stopped because of a signal; the message says where, and how to resume it."""

    def __init__(self, text: str, number: signal.Signals) -> None:
        # Both are kept as arguments, so that a process of a pool can pickle the error.
        super().__init__(text, number)
        self.text, self.number = text, number

    def __str__(self) -> str:
        return self.text


@dataclass
class Stop:
    """Whether a signal asked to stop, and which."""

    asked: signal.Signals | None = None


@contextmanager
def stop_on_signal() -> Iterator[Stop]:
    """Let the first Ctrl-C or SIGTERM only set `asked`; a second Ctrl-C interrupts at once.

    Slurm, Kubernetes and an ending launcher send SIGTERM. Signals arrive only in the main thread, so the
    context has no effect in other threads.
    """
    stop, interrupts, before = Stop(), 0, {}

    def ask(number: int, _: FrameType | None) -> None:
        nonlocal interrupts
        # Ctrl-C in a shell reaches this process and its launcher, which then sends SIGTERM too. So only
        # Ctrl-C counts as a second request.
        interrupts += number == signal.SIGINT
        if interrupts > 1:
            raise KeyboardInterrupt
        stop.asked = stop.asked or signal.Signals(number)

    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            # An ignored signal stays ignored, for example in a background process. None means that the
            # handler was not set from Python.
            if signal.getsignal(number) not in (signal.SIG_IGN, None):
                before[number] = signal.signal(number, ask)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class TerminatedError(BaseException):
    """SIGTERM in a process that must end its children before it ends."""


def raise_at_sigterm() -> None:
    """Raise `TerminatedError` at the first SIGTERM; ignore further ones."""

    def handle(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise TerminatedError

    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, handle)


def end_at_sigterm() -> None:
    """End the process at SIGTERM; the first process of a container would ignore it without a handler."""
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, lambda *_: end_by_signal(signal.SIGTERM))


def end_by_signal(number: signal.Signals) -> NoReturn:
    """End this process at once by a signal, as if the signal had no handler."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)
    # Reached only in the first process of a container, which the signal does not kill.
    os._exit(128 + number)
