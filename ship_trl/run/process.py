"""Configure a process, name its processor, and stop it at a signal between two steps. No torch at first."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import logging
import os
import platform
import re
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import NoReturn

from ship_trl.config.errors import print_error

CPUINFO = Path("/proc/cpuinfo")
# Options of mallopt, from glibc's malloc.h.
M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD = -1, -2, -3


def configure_process() -> None:
    """Use one torch thread, flush denormal numbers to zero, and keep freed memory between updates.

    Grids run one process per core, and two torch threads on two busy cores are many times slower than one.
    By default glibc maps and unmaps each large activation, which costs about a tenth of an update.
    Adam's averages of inactive units fall below 1e-38, where many processors are a hundred times slower.
    """
    import torch

    # safetensors is written in Rust. If it runs out of memory and prints a backtrace, which needs memory too,
    # it deadlocks.
    os.environ["RUST_BACKTRACE"] = "0"
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    # On a GPU: algorithms and memory that give the same bits each time.
    torch.backends.cudnn.deterministic = True
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    for option, value in ((M_MMAP_THRESHOLD, 1 << 30), (M_TRIM_THRESHOLD, 1 << 30), (M_TOP_PAD, 1 << 26)):
        call_glibc("mallopt", option, value)


def release_memory() -> None:
    """Return the memory of a finished run to the system.

    The run's parts form reference cycles, which Python rarely collects, and `configure_process` tells glibc
    to keep freed memory. A process that trained several runs with frozen layers held 4.5 GB and used 0.6 GB.
    """
    gc.collect()
    call_glibc("malloc_trim", 0)


def call_glibc(function: str, *arguments: int) -> None:
    """Call a function of glibc; without glibc do nothing."""
    with contextlib.suppress(AttributeError, OSError, TypeError):
        getattr(ctypes.CDLL(None), function)(*arguments)


def processor_name() -> str:
    """Return the name of the processor, with family and model if the system knows them.

    A virtual machine often shows only the vendor, but family and model tell the generation.
    """
    text = CPUINFO.read_text() if CPUINFO.is_file() else ""
    # The last of a key counts: the first core's.
    values = {key.strip(): value for key, value in reversed(re.findall(r"(?m)^(.+?):[ \t]*(.*)$", text))}
    name = values.get("model name") or platform.processor() or platform.machine()
    if "cpu family" in values and "model" in values:
        return f"{name} (family {values['cpu family']}, model {values['model']})"
    return name


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


def exit_at_sigterm(told: str) -> None:
    """At the first SIGTERM print a line and raise `SystemExit`, so that children are ended; ignore others."""

    def handle(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        print_error(told)
        sys.exit(128 + signal.SIGTERM)

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
