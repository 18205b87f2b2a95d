"""How this process uses the machine: one core, no denormal numbers, memory kept for the next update."""

from __future__ import annotations

import ctypes
import logging

import torch

# Numbers of glibc's malloc.h.
M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD = -1, -2, -3


def configure_process() -> None:
    """Set one torch thread, let denormal numbers be zero, and give no pages back between updates.

    Two torch threads on two busy cores are many times slower than one; grids run one process a
    core. glibc by itself maps and unmaps each large activation anew, and the page faults of that
    cost about a tenth of an update. Adam's averages of the gradients of units that no longer fire
    fall below 1e-38, where many processors take a hundred times as long for each operation.
    """
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    for option, value in ((M_MMAP_THRESHOLD, 1 << 30), (M_TRIM_THRESHOLD, 1 << 30), (M_TOP_PAD, 1 << 26)):
        mallopt(option, value)
