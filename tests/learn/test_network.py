"""The network, and its fast forms, which must compute the same function."""

import pytest
import torch
from torch import Generator, Tensor

from ship_trl.learn.network import DuelingNetwork
from tests.learn import networks
from tests.learn.networks import NETWORKS, ODD, plain_forward


def pixels(batch: int, channels: int = 1) -> Tensor:
    return torch.randint(
        0, 256, (batch, channels, 84, 84), dtype=torch.uint8, generator=Generator().manual_seed(1)
    )


def test_layers_are_those_of_section_3_5() -> None:
    net = networks.network()
    shapes = {name: tuple(getattr(net, name).weight.shape) for name in net.layer_names}
    assert shapes == {
        "conv1": (32, 1, 8, 8),
        "conv2": (64, 32, 4, 4),
        "conv3": (64, 64, 3, 3),
        "conv4": (200, 64, 7, 7),
    }
    assert [conv.stride[0] for conv in net.layers] == [4, 2, 1, 1]
    assert [tuple(layer.weight.shape) for layer in (net.shared, net.value, net.advantage)] == [
        (200, 200),
        (1, 200),
        (7, 200),
    ]


@pytest.mark.parametrize("name", [*NETWORKS, *ODD])
def test_the_fast_forward_equals_the_plain_one(name: str) -> None:
    for channels in (1, 3):
        net = networks.network(name, channels)
        images = pixels(5, channels)
        torch.testing.assert_close(net(images), plain_forward(net, images), rtol=1e-5, atol=5e-6)


@pytest.mark.parametrize("name", [*NETWORKS, *ODD])
def test_gradients_equal_the_plain_ones(name: str) -> None:
    net = networks.network(name)
    images = pixels(3)
    weights = list(net.parameters())
    fast = torch.autograd.grad(net(images).square().sum(), weights)
    slow = torch.autograd.grad(plain_forward(net, images).square().sum(), weights)
    for got, wanted in zip(fast, slow, strict=True):
        # Sums in another order: rounding is relative to the largest entries.
        torch.testing.assert_close(got, wanted, rtol=1e-4, atol=1e-5 * float(wanted.abs().max()))


def test_initial_weights_come_from_the_generator() -> None:
    first, again, other = (DuelingNetwork(1, 7, Generator().manual_seed(seed)) for seed in (3, 3, 4))
    for name, weight in first.named_parameters():
        assert torch.equal(weight, dict(again.named_parameters())[name])
        if name.endswith("weight"):
            assert not torch.equal(weight, dict(other.named_parameters())[name])
            bound = (6.0 / weight[0].numel()) ** 0.5
            assert 0.9 * bound < weight.abs().max() <= bound
        else:
            assert not weight.any()


@pytest.mark.parametrize("name", [*NETWORKS, *ODD])
def test_forward_continues_from_frozen_features(name: str) -> None:
    net, images = networks.network(name), pixels(3)
    with torch.no_grad():
        x = images / 255
        for layers, conv in enumerate(net.layers, 1):
            x = conv(x).relu()
            if layers >= net.linear_from:
                net.freeze(layers)
                kept = x.permute(0, 2, 3, 1).flatten(1)
                torch.testing.assert_close(net(kept), plain_forward(net, images), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("name", [*NETWORKS, *ODD])
def test_activations_are_what_the_next_layer_reads(name: str) -> None:
    net = networks.network(name)
    images = pixels(4)
    given = net.activations(images)
    assert list(given) == [*net.layer_names, "shared"]
    for conv, layer in zip(net.layer_names, net.geometry, strict=True):
        assert given[conv].shape == (4, layer.filters, layer.side, layer.side)
        assert bool((given[conv] >= 0).all())
    advantage = net.advantage(given["shared"])
    q = net.value(given["shared"]) + advantage - advantage.mean(1, keepdim=True)
    torch.testing.assert_close(q, net(images), rtol=1e-5, atol=5e-6)
