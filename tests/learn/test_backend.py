"""Both backends compute the same function; the choice of backend and precision."""

import pytest
import torch
from torch import Generator, Tensor

from ship_trl.config.types import BFLOAT16, Precision
from ship_trl.fast.incremental import Incremental
from ship_trl.fast.worlds import make_backend as make_fast
from ship_trl.learn.network import Dense, DuelingNetwork, choose_dtype, make_backend
from tests.learn.networks import NETWORKS, ODD
from tests.learn.worlds import draw, schedule


def both(network: DuelingNetwork, dtype: torch.dtype, frames: Tensor) -> list[Tensor]:
    found = []
    for backend in (Incremental(draw.background, dtype, network.geometry), Dense(dtype)):
        network.backend = backend
        found.append(network(frames))
    return found


def test_dense_bfloat16_is_close_to_float32() -> None:
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    frames, found = draw(torch.rand(6, 2) * 8 - 4), []
    for dtype in (torch.float32, torch.bfloat16):
        network.backend = Dense(dtype)
        found.append(network(frames))
    exact, rounded = found
    assert rounded.dtype is torch.float32 and not torch.equal(exact, rounded)
    assert (exact - rounded).abs().max() < 0.03 * exact.abs().max()


def test_fully_connected_layers_stay_float32_where_values_are_large() -> None:
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    frames = draw(torch.rand(40, 2) * 8 - 4)
    before = both(network, torch.bfloat16, frames)
    with torch.no_grad():
        network.value.bias.add_(1000.0)
    # bfloat16 has no number between 1000 and 1004.
    for after, wanted in zip(both(network, torch.bfloat16, frames), before, strict=True):
        torch.testing.assert_close(after - 1000.0, wanted, atol=2e-4, rtol=0)


@pytest.mark.parametrize(
    ("precision", "able", "wanted"),
    [
        ("auto", {"avx512_bf16": True}, torch.bfloat16),
        ("auto", {"amx_bf16": True, "avx512_bf16": False}, torch.bfloat16),
        ("auto", {"avx512_bf16": False}, torch.float32),
        ("auto", {}, torch.float32),
        ("fp32", {"avx512_bf16": True}, torch.float32),
        ("bf16", {}, torch.bfloat16),
    ],
)
def test_auto_is_bfloat16_where_the_processor_multiplies_it(
    precision: str, able: dict[str, bool], wanted: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: able)
    monkeypatch.delenv(BFLOAT16, raising=False)
    assert choose_dtype(Precision[precision], torch.device("cpu")) is wanted


@pytest.mark.parametrize("device", ["cpu", "cuda"])
@pytest.mark.parametrize(
    ("precision", "wanted"), [("auto", torch.float32), ("fp32", torch.float32), ("bf16", torch.bfloat16)]
)
def test_bfloat16_that_is_off_must_be_asked_for(
    precision: str, wanted: torch.dtype, device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_bf16": True})
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda **_: True)
    monkeypatch.setenv(BFLOAT16, "off")
    assert choose_dtype(Precision[precision], torch.device(device)) is wanted


@pytest.mark.parametrize("name", [*NETWORKS, *ODD])
def test_auto_is_incremental_where_supported(name: str) -> None:
    network = DuelingNetwork(1, 7, Generator().manual_seed(0), (NETWORKS | ODD)[name])
    able = Incremental if name in NETWORKS else Dense
    assert isinstance(make_backend(network, draw, schedule(), make_fast), able)
    assert isinstance(make_backend(network, draw, schedule(), None), Dense)
