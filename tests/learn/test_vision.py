"""Two ways of seeing, one function; and which precision computes."""

import pytest
import torch
from torch import Generator

from ship_trl.config import BFLOAT16, Precision
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.vision import DeltaVision, DenseVision, computing
from tests.learn.worlds import draw


def test_both_ways_of_seeing_give_the_same_q_values_and_parameters() -> None:
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    state = torch.rand(6, 2) * 8 - 4
    found = []
    for vision in (DeltaVision(draw, torch.float32), DenseVision(draw, torch.float32)):
        reader = vision.reader(network, 2)
        seen = reader.advance(vision.look(state), 2)
        found.append((reader.q_values(seen), {p.data_ptr() for p in reader.parameters}))
    torch.testing.assert_close(found[0][0], found[1][0], rtol=1e-4, atol=1e-6)
    frozen = {p.data_ptr() for n in ("conv1", "conv2") for p in getattr(network, n).parameters()}
    assert found[0][1] == found[1][1] == {p.data_ptr() for p in network.parameters()} - frozen


def test_dense_bfloat16_is_close_to_float32() -> None:
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    state = torch.rand(6, 2) * 8 - 4
    exact, rounded = (
        DenseVision(draw, dtype).reader(network, 0).q_values(draw(state))
        for dtype in (torch.float32, torch.bfloat16)
    )
    assert rounded.dtype is torch.float32 and not torch.equal(exact, rounded)
    assert (exact - rounded).abs().max() < 0.03 * exact.abs().max()


def test_fully_connected_layers_stay_float32_where_values_are_large() -> None:
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    state = torch.rand(40, 2) * 8 - 4
    reader = DenseVision(draw, torch.bfloat16).reader(network, 0)
    before = reader.q_values(draw(state))
    with torch.no_grad():
        network.value.bias.add_(1000.0)
    after = reader.q_values(draw(state))
    # bfloat16 knows no number between 1000 and 1004.
    torch.testing.assert_close(after - 1000.0, before, atol=2e-4, rtol=0)


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
    assert computing(Precision[precision], torch.device("cpu")) is wanted


@pytest.mark.parametrize("device", ["cpu", "cuda"])
@pytest.mark.parametrize(
    ("precision", "wanted"), [("auto", torch.float32), ("fp32", torch.float32), ("bf16", torch.bfloat16)]
)
def test_switched_off_bfloat16_is_only_where_it_is_asked_for(
    precision: str, wanted: torch.dtype, device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_bf16": True})
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda **_: True)
    monkeypatch.setenv(BFLOAT16, "off")
    assert computing(Precision[precision], torch.device(device)) is wanted
