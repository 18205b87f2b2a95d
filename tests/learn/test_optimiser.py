"""Adam on channels-last filters equals torch's own."""

import copy

import pytest
import torch
from torch import Generator

from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam


@pytest.mark.parametrize("layout", [torch.channels_last, torch.contiguous_format])
def test_it_steps_as_torchs_adam_does(layout: torch.memory_format) -> None:
    mine = DuelingNetwork(1, 7, Generator().manual_seed(0))
    other = copy.deepcopy(mine)
    optimisers = (ChannelsLastAdam(mine.parameters(), lr=0.01), torch.optim.Adam(other.parameters(), lr=0.01))
    for k in range(3):
        generator = Generator().manual_seed(k)
        for one, two in zip(mine.parameters(), other.parameters(), strict=True):
            gradient = torch.randn(one.shape, generator=generator)
            two.grad = gradient
            one.grad = gradient.contiguous(memory_format=layout) if one.dim() == 4 else gradient
        for optimiser in optimisers:
            optimiser.step()
    for one, two in zip(mine.parameters(), other.parameters(), strict=True):
        torch.testing.assert_close(one, two, rtol=1e-5, atol=1e-6)
    kept = optimisers[0].state_dict()["state"]
    assert {name for entry in kept.values() for name in entry} == {"step", "exp_avg", "exp_avg_sq"}
