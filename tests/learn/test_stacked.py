"""Stacked networks compute what each of them computes alone."""

import pytest
import torch
from torch import Generator, Tensor
from torch.func import stack_module_state

from ship_trl.config.network import ConvLayer, load_network
from ship_trl.learn.network import make_network
from ship_trl.learn.stacked import Windows, make_stacked_q

ACTIONS, COUNT, BATCH = 7, 3, 2


def inputs(network: str, generator: Generator) -> Tensor:
    """Return what the networks see, [COUNT, BATCH, ...]."""
    if network == "vector":
        return torch.rand(COUNT, BATCH, load_network(network).inputs, generator=generator)
    pixels = torch.randint(0, 256, (COUNT, BATCH, 1, 84, 84), generator=generator)
    return pixels.to(torch.uint8)


@pytest.mark.parametrize("network", ["paper", "five", "vector"])
def test_each_network_has_its_own_q_values_and_gradients(network: str) -> None:
    config = load_network(network)
    alone = [make_network(config, ACTIONS, Generator().manual_seed(seed)) for seed in range(COUNT)]
    stacked = {name: value.detach() for name, value in stack_module_state(list(alone))[0].items()}
    for value in stacked.values():
        value.requires_grad_()
    seen = inputs(network, Generator().manual_seed(9))
    q = make_stacked_q(alone[0])(stacked, seen)
    (q * torch.arange(ACTIONS)).sum().backward()
    for k, one in enumerate(alone):
        own = one(seen[k])
        torch.testing.assert_close(q[k], own, rtol=1e-4, atol=1e-4)
        (own * torch.arange(ACTIONS)).sum().backward()
        for name, parameter in one.named_parameters():
            gradient = stacked[name].grad
            assert gradient is not None and parameter.grad is not None
            scale = parameter.grad.abs().max()
            torch.testing.assert_close(gradient[k], parameter.grad, rtol=1e-3, atol=1e-4 * float(scale))


@pytest.mark.parametrize(
    "layer", [ConvLayer(1, 4, 2, 20), ConvLayer(1, 3, 1, 9), ConvLayer(1, 3, 2, 8), ConvLayer(1, 2, 3, 10)]
)
def test_windows_are_those_of_a_convolution(layer: ConvLayer) -> None:
    maps = torch.rand(2, layer.below, layer.below, 5, dtype=torch.float64, requires_grad=True)
    weight = torch.rand(6, 5, layer.kernel, layer.kernel, dtype=torch.float64)
    product = Windows.apply(maps, layer) @ weight.permute(0, 2, 3, 1).flatten(1).T
    wanted = torch.nn.functional.conv2d(maps.permute(0, 3, 1, 2), weight, stride=layer.stride)
    torch.testing.assert_close(product.view(2, layer.side, layer.side, 6), wanted.permute(0, 2, 3, 1))
    factors = torch.rand_like(wanted)
    (wanted_gradient,) = torch.autograd.grad((wanted * factors).sum(), maps)
    (gradient,) = torch.autograd.grad(
        (product.view_as(factors.permute(0, 2, 3, 1)) * factors.permute(0, 2, 3, 1)).sum(), maps
    )
    torch.testing.assert_close(gradient, wanted_gradient, rtol=1e-5, atol=1e-5)
