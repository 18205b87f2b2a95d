"""The processor and what it reaches at best, measured here and now with torch's own kernels."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from ship_trl.bench.timing import Probe, measure
from ship_trl.run.process import processor_name

# Large enough to leave the caches' start-up behind, small enough for a tenth of a second.
MATRIX = 1024
# Four times the last-level cache of a large processor: the copy goes through memory.
COPY_BYTES = 1 << 28


@dataclass(frozen=True)
class Machine:
    """Processor and peaks: GFLOP/s of matrix products, GB/s of a copy (read and written)."""

    processor: str
    cores: int
    threads: int
    torch: str
    fp32: float
    bf16: float
    copy: float

    def peak(self, precision: str) -> float:
        """FLOP/s of the processor's best matrix product in `fp32` or `bf16`."""
        return 1e9 * (self.bf16 if precision == "bf16" else self.fp32)


def product(size: int, dtype: torch.dtype) -> Callable[[], int]:
    """Multiply square matrices; counts floating point operations."""
    left, right = torch.rand(size, size).to(dtype), torch.rand(size, size).to(dtype)
    out = torch.empty(size, size, dtype=dtype)

    def run() -> int:
        torch.mm(left, right, out=out)
        return 2 * size**3

    return run


def copy(count: int) -> Callable[[], int]:
    """Copy `count` bytes; counts what is read and what is written."""
    source: Tensor = torch.ones(count, dtype=torch.uint8)
    target = torch.empty_like(source)

    def run() -> int:
        target.copy_(source)
        return 2 * count

    return run


def survey(
    rounds: int = 3, seconds: float = 0.2, size: int = MATRIX, copy_bytes: int = COPY_BYTES
) -> Machine:
    """Measure the processor, with as many threads as torch now uses."""
    probes = [
        Probe("fp32", product(size, torch.float32)),
        Probe("bf16", product(size, torch.bfloat16)),
        Probe("copy", copy(copy_bytes)),
    ]
    # The best round, not the median: a peak is what the processor can do, whatever else it does.
    peak = {timing.probe.name: timing.high / 1e9 for timing in measure(probes, rounds, seconds)}
    return Machine(
        processor=processor_name(),
        cores=os.cpu_count() or 1,
        threads=torch.get_num_threads(),
        torch=torch.__version__,
        **peak,
    )
