"""The count from shapes against torch's own counter of what is really computed."""

import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from ship_trl.bench.flops import forward_flops, layers_of, update_flops
from ship_trl.bench.ours import frozen_layers, network_layers
from ship_trl.bench.peer_network import PlainNetwork, freeze

BATCH = 2


def counted(frozen: int, double: bool) -> int:
    """Operations of an update of the plain network, frozen layers of the next pictures passed once."""
    network, target = PlainNetwork(7), PlainNetwork(7)
    freeze(network.convs, frozen)
    pixels = torch.randint(256, (BATCH, 1, 84, 84), dtype=torch.uint8)

    def rest(net: PlainNetwork, x: torch.Tensor) -> torch.Tensor:
        for conv in net.convs[frozen:]:
            x = conv(x).relu()
        return net.head(x.flatten(-3))

    with FlopCounterMode(display=False) as counter:
        with torch.no_grad():
            x = pixels / 255.0
            for conv in network.convs[:frozen]:
                x = conv(x).relu()
            for net in (network, target) if double else (target,):
                rest(net, x)
        network(pixels).square().sum().backward()
    return counter.get_total_flops()


@pytest.mark.parametrize("frozen", range(5))
@pytest.mark.parametrize("double", [False, True])
def test_an_update_is_counted_right(frozen: int, double: bool) -> None:
    assert update_flops(network_layers(), BATCH, frozen, double) == counted(frozen, double)


def test_forward_of_the_papers_network_by_hand() -> None:
    places = {"conv1": 20 * 20, "conv2": 9 * 9, "conv3": 7 * 7, "conv4": 1}
    weights = {"conv1": 32 * 64, "conv2": 64 * 32 * 16, "conv3": 64 * 64 * 9, "conv4": 200 * 64 * 49}
    by_hand = 2 * (sum(places[k] * weights[k] for k in places) + 200 * (200 + 1 + 7))
    assert forward_flops(network_layers(), 1) == by_hand
    assert forward_flops(layers_of(PlainNetwork(7)), 3) == 3 * by_hand


def test_arms() -> None:
    assert [frozen_layers(arm) for arm in ("scratch", "FE1", "FE4", "FT3")] == [0, 1, 4, 0]
    with pytest.raises(ValueError, match="frozen"):
        update_flops(network_layers(), 1, 5)
