"""How a run uses the machine."""

from collections.abc import Iterator

import pytest
import torch

from ship_trl.run.process import configure_process


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
