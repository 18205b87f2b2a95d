"""How a run uses the machine."""

import platform
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

from ship_trl.run.process import configure_process, release_memory


@pytest.fixture
def able() -> Iterator[bool]:
    """Whether the processor can let denormal numbers be zero, once settled."""
    found = torch.set_flush_denormal(False)
    configure_process()
    yield found
    torch.set_flush_denormal(False)


def test_numbers_that_cost_a_hundred_times_as_much_are_zero_where_they_can_be(able: bool) -> None:
    assert torch.get_num_threads() == 1
    # Adam's average of the gradients of a unit that fired once and never again.
    average = torch.full((64,), 1e-37)
    for _ in range(40):
        average *= 0.9
    assert (float(average.abs().max()) == 0.0) == able


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="glibc's memory alone is kept")
def test_memory_is_kept_between_updates_and_given_back_after_a_run() -> None:
    configure_process()
    parts = [torch.ones(25_000_000) for _ in range(4)]
    # A run leaves small things behind it, without which glibc would give back all that is above them.
    left = torch.ones(1000)
    held = resident()
    parts.clear()
    assert resident() > held - 50
    release_memory()
    assert resident() < held - 300 and float(left.sum()) == 1000


def resident() -> float:
    """MB of this process that are in memory."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024
