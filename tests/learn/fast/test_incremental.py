"""The conv layers on what differs from a background are the conv layers."""

import copy
from itertools import pairwise
from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Generator, Tensor

from ship_trl.config.network import geometry
from ship_trl.learn.fast.cutter import Cutter, rounded
from ship_trl.learn.fast.incremental import Incremental
from ship_trl.learn.fast.inference import CachedInference
from ship_trl.learn.network import DuelingNetwork
from tests.learn.networks import NETWORKS, ODD, network, plain_forward

PAPER = geometry(NETWORKS["paper"])


def scene(batch: int, channels: int, patches: int, seed: int) -> tuple[Tensor, Tensor]:
    """A background of noise, and frames that differ from it in some patches."""
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


def gradients(net: DuelingNetwork, q: Tensor) -> dict[str, Tensor]:
    (q * torch.linspace(-1, 1, q.numel()).view_as(q)).sum().backward()
    return {name: p.grad for name, p in net.named_parameters() if p.grad is not None}


def incremental(net: DuelingNetwork, frames: Tensor, background: Tensor, dtype: torch.dtype) -> Any:
    """Q-values and gradients by windows."""
    net.backend = Incremental(background, dtype, net.geometry)
    q = net(frames)
    return q.detach(), gradients(net, q)


@pytest.mark.parametrize("name", NETWORKS)
@settings(max_examples=12)
@given(
    batch=st.integers(1, 4),
    channels=st.sampled_from([1, 3]),
    patches=st.integers(0, 4),
    frozen=st.integers(0, 5),
    seed=st.integers(0, 1000),
)
def test_incremental_equals_the_network_and_its_gradient(
    name: str, batch: int, channels: int, patches: int, frozen: int, seed: int
) -> None:
    background, frames = scene(batch, channels, patches, seed)
    frozen = min(frozen, len(NETWORKS[name].conv))
    dense = network(name, channels, frozen)
    q = plain_forward(dense, frames)
    wanted = gradients(dense, q)
    got_q, got = incremental(network(name, channels, frozen), frames, background, torch.float32)
    torch.testing.assert_close(got_q, q.detach(), rtol=1e-4, atol=1e-5)
    assert got.keys() == wanted.keys()
    for key, gradient in wanted.items():
        # Thousands of rounded numbers are added in another order; small sums of large ones are left.
        torch.testing.assert_close(got[key], gradient, rtol=1e-3, atol=1e-4 * float(gradient.abs().max() + 1))


def test_the_background_changes_the_work_and_not_the_result() -> None:
    background, frames = scene(3, 1, 2, 0)
    net, wrong = network(), torch.zeros_like(background)
    right, dense = (Cutter(still, torch.float32, PAPER)(frames) for still in (background, wrong))
    assert len(right.values) < len(dense.values)
    found = [incremental(net, frames, picture, torch.float32)[0] for picture in (background, wrong)]
    torch.testing.assert_close(*found, rtol=1e-4, atol=1e-5)


def test_frames_equal_to_the_background_add_no_rows() -> None:
    background, frames = scene(5, 1, 0, 0)
    rows = Cutter(background, torch.float32, PAPER)(frames)
    places = (20 * 20, 9 * 9, 7 * 7)
    counts = (len(rows.values), *(len(index) for index in rows.indices[1:3] if index is not None))
    assert counts == tuple(rounded(p) for p in places)


def test_bfloat16_is_close_and_leaves_the_weights_float32() -> None:
    background, frames = scene(8, 1, 3, 4)
    dense = network()
    q = dense(frames)
    wanted = gradients(dense, q)
    net = network()
    got_q, got = incremental(net, frames, background, torch.bfloat16)
    assert (got_q - q).abs().max() < 0.02 * q.abs().max()
    assert got_q.dtype is torch.float32 and all(p.dtype is torch.float32 for p in net.parameters())
    for name, gradient in wanted.items():
        if gradient.numel() == 1:  # the value's bias: these weights of the Q-values sum to zero
            continue
        cosine = torch.nn.functional.cosine_similarity(got[name].flatten(), gradient.flatten(), dim=0)
        assert cosine > 0.95, name


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("frozen", [0, 2])
def test_weights_and_frames_may_change_at_any_time(dtype: torch.dtype, frozen: int) -> None:
    background, frames = scene(2, 1, 2, 1)
    net = network(frozen=frozen)
    net.backend = Incremental(background, dtype, net.geometry)

    def alone() -> Tensor:
        other = copy.deepcopy(net)
        other.backend = Incremental(background, dtype, net.geometry)
        return other(frames)

    found = [net(frames)]
    for name in ("conv1", "conv3", "value"):
        with torch.no_grad():
            getattr(net, name).weight.mul_(1.5)
        found.append(net(frames))
        assert torch.equal(found[-1], alone())
    frames[0, :, 30:40] = 7
    found.append(net(frames))
    assert torch.equal(found[-1], alone())
    assert all(not torch.equal(one, other) for one, other in pairwise(found))


def test_networks_of_other_frozen_layers_may_share_it() -> None:
    background, frames = scene(2, 1, 2, 1)
    nets = [network(frozen=2, seed=seed) for seed in (0, 1)]
    backend = Incremental(background, torch.float32, nets[0].geometry)
    for net in nets:
        wanted = net(frames)
        net.backend = backend
        torch.testing.assert_close(net(frames), wanted, rtol=1e-4, atol=1e-5)


def test_weights_of_another_memory_layout_are_refused() -> None:
    background, frames = scene(1, 1, 1, 0)
    net = network()
    net.convs[1].weight.data = net.convs[1].weight.data.contiguous()
    net.backend = Incremental(background, torch.float32, net.geometry)
    with pytest.raises(RuntimeError, match="view"):
        net(frames)


@pytest.mark.parametrize("name", NETWORKS)
@settings(max_examples=12)
@given(
    batch=st.integers(1, 3),
    channels=st.sampled_from([1, 3]),
    patches=st.integers(0, 4),
    frozen=st.integers(0, 5),
    seed=st.integers(0, 1000),
)
def test_cached_inference_decides_like_the_network(
    name: str, batch: int, channels: int, patches: int, frozen: int, seed: int
) -> None:
    background, frames = scene(batch, channels, patches, seed)
    frozen = min(frozen, len(NETWORKS[name].conv))
    net = network(name, channels, frozen)
    inference = CachedInference(net, background, frozen)
    for change in (1.0, -1.3):  # what was remembered must be forgotten when weights change
        with torch.no_grad():
            for parameter in net.parameters():
                if parameter.requires_grad:
                    parameter.mul_(change)
        assert torch.equal(inference.actions(frames), net(frames).argmax(-1))
        # No more rows than places that differ, and no frame depends on its neighbours.
        one_by_one = torch.cat([inference.actions(frame.unsqueeze(0)) for frame in frames])
        assert torch.equal(one_by_one, net(frames).argmax(-1))
    if frozen >= net.linear_from:
        features, layer = inference.encode(frames), net.geometry[frozen - 1]
        assert features.shape == (batch, layer.filters * layer.side**2)
        torch.testing.assert_close(net(features), net(frames), rtol=1e-4, atol=1e-5)
        assert torch.equal(inference.actions_from_features(features), net(frames).argmax(-1))


def test_cached_inference_computes_only_what_differs() -> None:
    background, frames = scene(1, 1, 2, 5)
    cut = Cutter(background, torch.float32, PAPER)
    whole, few = cut(frames), cut(frames, background=False)
    places = (20 * 20, 9 * 9, 7 * 7)
    counts = [len(few.values), *(len(index) for index in few.indices[1:3] if index is not None)]
    full = [len(whole.values), *(len(index) for index in whole.indices[1:3] if index is not None)]
    for count, all_rows, place in zip(counts, full, places, strict=True):
        assert 0 < count <= all_rows - place + 8
    nothing = cut(background.unsqueeze(0), background=False)
    assert len(nothing.values) == 0
    net = network()
    assert torch.equal(
        CachedInference(net, background, 0).actions(background[None]), net(background[None]).argmax(-1)
    )


@pytest.mark.parametrize("name", ODD)
def test_layers_that_the_incremental_backend_cannot_cut_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="must have several layers"):
        Incremental(torch.zeros(1, 84, 84, dtype=torch.uint8), torch.float32, geometry(ODD[name]))


def test_a_network_of_other_layers_is_refused() -> None:
    background, frames = scene(1, 1, 1, 0)
    net = network("five")
    net.backend = Incremental(background, torch.float32, PAPER)
    with pytest.raises(ValueError, match="its conv layers differ"):
        net(frames)
