"""The incremental backend computes the same function as stock convolutions."""

import pickle
from typing import Any

import pytest
import torch
from torch import Generator, Tensor

from ship_trl.config.network import geometry
from ship_trl.fast.incremental import Incremental, Rows, WindowExtractor
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.cases import load_case, load_world
from tests.learn.networks import NETWORKS, ODD, network
from tests.sim.scenes import scenes

PAPER = geometry(NETWORKS["paper"])
# Windows of the first three layers of the paper's network.
WINDOWS = (20 * 20, 9 * 9, 7 * 7)


def scene(batch: int, channels: int, patches: int, seed: int) -> tuple[Tensor, Tensor]:
    """Return a background of noise, and frames that differ from it in some patches."""
    generator = Generator().manual_seed(seed)
    noise = lambda *shape: torch.randint(256, shape, generator=generator, dtype=torch.uint8)  # noqa: E731
    background = noise(channels, 84, 84)
    frames = background.repeat(batch, 1, 1, 1)
    for frame in frames:
        for _ in range(patches):
            top, left, height, width = torch.randint(0, 84, (4,), generator=generator).tolist()
            patch = frame[:, top : top + height, left : left + width // 4]
            patch.copy_(noise(*patch.shape))
    return background, frames


def row_counts(rows: Rows) -> tuple[int, ...]:
    """Return the numbers of rows of the first three layers."""
    return len(rows.values), *(len(index) for index in rows.indices[1:3] if index is not None)


def gradients(net: DuelingNetwork, q: Tensor) -> dict[str, Tensor]:
    (q * torch.linspace(-1, 1, q.numel()).view_as(q)).sum().backward()
    return {name: p.grad for name, p in net.named_parameters() if p.grad is not None}


def incremental(net: DuelingNetwork, frames: Tensor, background: Tensor, dtype: torch.dtype) -> Any:
    """Return Q-values and gradients of the incremental backend."""
    net.backend = Incremental(background, dtype, net.geometry)
    q = net(frames)
    return q.detach(), gradients(net, q)


@pytest.mark.parametrize("name", ODD)
def test_layers_that_the_incremental_backend_does_not_support_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="kernel and stride in multiples of 4"):
        Incremental(torch.zeros(1, 84, 84, dtype=torch.uint8), torch.float32, geometry(ODD[name]))


def test_a_network_of_other_layers_is_refused() -> None:
    background, frames = scene(1, 1, 1, 0)
    net = network("five")
    net.backend = Incremental(background, torch.float32, PAPER)
    with pytest.raises(ValueError, match="its conv layers differ"):
        net(frames)


def test_speed_vectors_are_only_more_windows() -> None:
    world = load_world()
    draw, plain = make_rasteriser(world, vector_time=20.0), make_rasteriser(world)
    generator = Generator().manual_seed(0)
    row = torch.rand(8, 4, generator=generator) * torch.tensor([400.0, 400.0, 6.0, 30.0])
    states = scenes(load_case("6", world), world, row)
    net, dense = network("paper"), network("paper")
    dense.load_state_dict(net.state_dict())
    wanted = dense(draw(states))
    got, gradient = incremental(net, draw(states), draw.background, torch.float32)
    torch.testing.assert_close(got, wanted.detach(), rtol=1e-4, atol=1e-5)
    for name, expected in gradients(dense, wanted).items():
        torch.testing.assert_close(gradient[name], expected, rtol=1e-3, atol=1e-4)
    extract = WindowExtractor(draw.background, torch.float32, net.geometry)
    assert row_counts(extract(draw(states)))[0] > row_counts(extract(plain(states)))[0]


def test_a_network_that_has_learned_goes_to_another_process() -> None:
    net, (background, frames) = network("paper"), scene(4, 1, 2, 0)
    q, _ = incremental(net, frames, background, torch.float32)
    sent = pickle.dumps(net)
    assert torch.equal(pickle.loads(sent)(frames), q) and frames[:2].numpy().tobytes() not in sent
