"""How this process uses the machine, and what machine it is: one core, no denormal numbers, memory kept."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import logging
import os
import platform
from pathlib import Path

import torch

CPUINFO = Path("/proc/cpuinfo")
# Numbers of glibc's malloc.h.
M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD = -1, -2, -3


def configure_process() -> None:
    """Set one torch thread, let denormal numbers be zero, and give no pages back between updates.

    Two torch threads on two busy cores are many times slower than one; grids run one process a
    core. glibc by itself maps and unmaps each large activation anew, and the page faults of that
    cost about a tenth of an update. Adam's averages of the gradients of units that no longer fire
    fall below 1e-38, where many processors take a hundred times as long for each operation.
    """
    # safetensors is written in Rust: where it has no memory, and is to print a backtrace, that wants memory
    # too, and waits forever for a lock that it holds itself.
    os.environ["RUST_BACKTRACE"] = "0"
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    for option, value in ((M_MMAP_THRESHOLD, 1 << 30), (M_TRIM_THRESHOLD, 1 << 30), (M_TOP_PAD, 1 << 26)):
        of_glibc("mallopt", option, value)


def release_memory() -> None:
    """Give the memory of a run that is over back to the system.

    Its parts refer to one another in a circle (a replay and its transforms do), which Python finds now and
    then; and what is free glibc keeps, as `configure_process` tells it to. A process that trained runs with
    frozen layers, one after another, so held 4.5 GB, of which it used 0.6.
    """
    gc.collect()
    of_glibc("malloc_trim", 0)


def of_glibc(function: str, *arguments: int) -> None:
    """Call a function of glibc, where there is one."""
    with contextlib.suppress(AttributeError, OSError, TypeError):
        getattr(ctypes.CDLL(None), function)(*arguments)


def processor_name() -> str:
    """Return the processor as the system calls it, with family and model where it tells them.

    A virtual machine often hides all but the maker; the numbers still tell one generation from another.
    """
    try:
        lines = CPUINFO.read_text().splitlines()
    except OSError:
        lines = []
    pairs = [line.partition(":") for line in lines]
    # The first core's come first, and dict would keep the last's.
    told = {key.strip(): value.strip() for key, _, value in reversed(pairs)}
    name = told.get("model name") or platform.processor() or platform.machine()
    if "cpu family" in told and "model" in told:
        return f"{name} (family {told['cpu family']}, model {told['model']})"
    return name
