"""Which layers are copied and frozen, and what is refused as a source."""

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from torch import Generator, Tensor

from ship_trl.config.arm import Arm
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.types import Network, plain
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.transfer.methods import make_method
from ship_trl.transfer.weights import load_weights, permute_values, read_look, save_weights

FIVE, VECTOR = load_network("five"), load_network("vector")


def network(seed: int, channels: int = 1, config: Network | None = None) -> DuelingNetwork:
    generator = Generator().manual_seed(seed)
    return make_network(config or load_network(), 7, generator, colour=channels == 3)


def tensors_of(net: DuelingNetwork) -> dict[str, Tensor]:
    """Return a network's weights as safetensors stores them."""
    return {key: value.contiguous() for key, value in net.state_dict().items()}


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "policy.safetensors"
    save_weights(path, network(1), {"case": "1"})
    return path


def test_permuting_keeps_the_numbers_of_each_tensor_and_no_order() -> None:
    learned = network(1).state_dict() | {"conv1.bias": torch.arange(32.0)}
    one, again = (permute_values(learned, Generator().manual_seed(5)) for _ in range(2))
    other = permute_values(learned, Generator().manual_seed(6))
    assert one.keys() == learned.keys()
    for key, value in learned.items():
        assert one[key].shape == value.shape and torch.equal(one[key], again[key])
        assert torch.equal(one[key].flatten().sort().values, value.flatten().sort().values)
    for key in ("conv1.weight", "conv4.weight", "conv1.bias"):
        assert not torch.equal(one[key], learned[key]) and not torch.equal(one[key], other[key])


def test_saving_and_loading_keeps_every_bit_and_the_layout(saved: Path) -> None:
    source, target = network(1), network(2)
    make_method(Arm.parse("FTW")).copy(target, load_weights(saved, target))
    for a, b in zip(source.parameters(), target.parameters(), strict=True):
        assert torch.equal(a, b) and a.stride() == b.stride()
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def refused(path: Path, channels: int = 1) -> str:
    with pytest.raises(ConfigError) as caught:
        load_weights(path, network(0, channels))
    message = str(caught.value)
    assert message.startswith("source_file: ") and "\n" not in message
    return message


def test_a_truncated_file_is_refused(saved: Path) -> None:
    whole = saved.read_bytes()
    for length in (0, 4, 100, len(whole) // 2, len(whole) - 1):
        saved.write_bytes(whole[:length])
        assert "not a whole safetensors file" in refused(saved)


def test_weights_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    tensors, path = tensors_of(network(0)), tmp_path / "nan.safetensors"
    save_file(tensors | {"value.bias": torch.tensor([float("nan")])}, path)
    assert "value.bias must hold finite" in refused(path)
    save_file(tensors | {"value.bias": torch.zeros(1, dtype=torch.float64)}, path)
    assert "value.bias must hold finite torch.float32" in refused(path)


def test_a_file_describes_its_network(saved: Path, tmp_path: Path) -> None:
    assert read_look(saved, "policy")[0] == load_network()
    path = tmp_path / "five.safetensors"
    save_weights(path, network(1, config=FIVE), {"episode": 3})
    assert read_look(path, "policy")[0] == FIVE
    assert "has other layers: conv=[[32, 8, 4], [64, 4, 2], [64, 3, 1], [64, 3, 1]," in refused(path)
    save_weights(path, network(1, config=VECTOR), {"episode": 3})
    assert read_look(path, "policy")[0] == VECTOR
    loaded = load_weights(path, network(2, config=VECTOR))
    assert all(
        torch.equal(value, loaded[key]) for key, value in network(1, config=VECTOR).state_dict().items()
    )
    assert (
        "has other layers: linear=[128, 128, 256, 256] ships=8 per_ship=2 encounters=True; allowed: conv="
        in refused(path)
    )
    # Older files do not describe their network: it is the paper's.
    save_file(tensors_of(network(0)), path)
    assert read_look(path, "policy")[0] == load_network()


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ("{", "Expecting property name"),
        ('{"network": {"conv": [[32, 8, 4]], "hidden": "${oc.env:HOME}"}}', 'got "${oc.env:HOME}"'),
        ('{"network": {"linear": [8, 200], "ships": 1}}', "linear1.weight has another shape"),
        ('{"network": {"conv": [[32, 8, 4]], "hidden": 200}}', "must be 84"),
        (json.dumps({"network": {**plain(load_network()), "hidden": 100}}), "shared.weight has another"),
    ],
)
def test_a_header_that_does_not_describe_its_network_is_refused(
    header: str, reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "policy.safetensors"
    save_file(tensors_of(network(0)), path, metadata={"ship_trl": header})
    with pytest.raises(ConfigError) as caught:
        read_look(path, "policy")
    message = str(caught.value)
    assert message.startswith(f"policy: {path}: its header does not describe its network (")
    assert reason in message and "\n" not in message


@pytest.mark.parametrize("shape", [(), (3,)])
def test_weights_of_too_few_dimensions_are_refused(shape: tuple[int, ...], tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    save_file({"conv1.weight": torch.zeros(shape)}, path)
    with pytest.raises(ConfigError, match="does not fit the network"):
        load_weights(path, network(0))


def test_a_layer_that_is_not_copied_may_have_another_size(saved: Path) -> None:
    fewer = make_network(load_network(), 3, Generator().manual_seed(2))
    with pytest.raises(ConfigError, match=r"advantage\.bias has shape \(7,\), allowed \(3,\)"):
        load_weights(saved, fewer)
    weights = load_weights(saved, fewer, free=("advantage",))
    assert set(fewer.state_dict()) - set(weights) == {"advantage.weight", "advantage.bias"}
    with pytest.raises(ConfigError, match="has other layers"):
        load_weights(saved, make_network(FIVE, 3, Generator()), free=("advantage",))
