"""A network as ONNX does what it does in torch, on a whole episode and on any batch."""

import json
from pathlib import Path
from typing import Any

import onnx
import onnxruntime
import pytest
import torch
from torch import Generator, Tensor

from ship_trl import load_policy
from ship_trl.cli.export import main
from ship_trl.cli.record import main as record
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import describe_network, load_network
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.policies import export
from ship_trl.transfer.weights import save_weights
from tests.cli.test_evaluate import table
from tests.command import refused
from tests.learn.networks import network


def saved(path: Path) -> DuelingNetwork:
    """A network that has learned nothing, as a file."""
    made = network("paper", 1)
    save_weights(path, made, {"config_hash": "0123456789ab", "episode": 5})
    return made


def values(path: Path, observed: Tensor, key: str = "pixels") -> Tensor:
    """What onnxruntime computes."""
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return torch.from_numpy(session.run(["action_value"], {key: observed.numpy()})[0])


def test_the_command_exports_and_checks_on_an_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    made = saved(tmp_path / "policy.safetensors")
    main(["policy.safetensors", "q.onnx", "target=4"])
    said = capsys.readouterr().out
    assert "q.onnx: case 4, policy.safetensors; pixels uint8 [batch, 1, 84, 84] -> action_value" in said
    assert "checked in onnxruntime on an episode of " in said and "the same actions" in said
    for batch in (1, 5):
        pixels = torch.randint(
            256, (batch, 1, 84, 84), dtype=torch.uint8, generator=Generator().manual_seed(1)
        )
        torch.testing.assert_close(values(tmp_path / "q.onnx", pixels), made(pixels).detach())
    session = onnxruntime.InferenceSession(tmp_path / "q.onnx", providers=["CPUExecutionProvider"])
    about = session.get_modelmeta().custom_metadata_map
    assert (about["case"], about["config_hash"], about["episode"]) == ("4", "0123456789ab", "5")
    assert len(json.loads(about["actions"])) == 7
    assert json.loads(about["network"]) == describe_network(load_network())
    assert {path.name for path in tmp_path.iterdir()} == {"policy.safetensors", "q.onnx"}
    words = ["policy.safetensors", "q.onnx", "target=4"]
    network, model = (row[2:] for row in table(capsys, *words))
    assert model == network
    record([*words, "--trajectories", "paths.png"])
    policy = load_policy("q.onnx")
    assert policy.env_options == {"observation": "pixels", "colour": False, "vector_time": 0.0}
    seen = pixels.movedim(1, -1).numpy()
    assert policy.predict(seen)[0].tolist() == made(pixels).argmax(-1).tolist()


def test_what_is_no_exported_model_is_refused(tmp_path: Path) -> None:
    for name, text in (("text.onnx", b"text"), ("empty.onnx", b"")):
        (tmp_path / name).write_bytes(text)
        with pytest.raises(ConfigError, match=f"policy: .*{name} is not a model of ship-trl export for this"):
            load_policy(tmp_path / name)
    node = onnx.helper.make_node("Cast", ["pixels"], ["action_value"], to=onnx.TensorProto.FLOAT)
    kinds = {"pixels": onnx.TensorProto.UINT8, "action_value": onnx.TensorProto.FLOAT}
    shape = ["batch", 1, 84, 84]
    infos = [onnx.helper.make_tensor_value_info(name, kind, shape) for name, kind in kinds.items()]
    graph = onnx.helper.make_graph([node], "other", infos[:1], infos[1:])
    opsets = [onnx.helper.make_opsetid("", 18)]
    model = onnx.helper.make_model(graph, ir_version=10, opset_imports=opsets)
    for metadata, why in (
        ({}, "network"),
        ({"network": json.dumps(describe_network(load_network()))}, "input and output: must be"),
    ):
        onnx.helper.set_model_props(model, metadata)
        onnx.save(model, tmp_path / "other.onnx")
        with pytest.raises(ConfigError, match=rf"other\.onnx is not a model of ship-trl export .*{why}"):
            load_policy(tmp_path / "other.onnx")
    with pytest.raises(ConfigError, match=r"policy: no file none\.onnx; allowed: a \.onnx file that exists"):
        load_policy("none.onnx")


def saved_numbers(path: Path) -> DuelingNetwork:
    """A network of numbers that has learned nothing, as a file."""
    made = make_network(load_network("vector"), 7, Generator().manual_seed(0))
    save_weights(path, made, {})
    return made


def test_a_network_of_numbers_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = saved_numbers(tmp_path / "vector.safetensors")
    main(["vector.safetensors", "vector.onnx", "target=4"])
    said = capsys.readouterr().out
    assert "vector float32 [batch, 158] -> action_value float32 [batch, 7]" in said and "the same act" in said
    numbers = torch.randn(3, 158, generator=Generator().manual_seed(2))
    torch.testing.assert_close(values(tmp_path / "vector.onnx", numbers, "vector"), made(numbers).detach())


def test_a_mask_is_left_to_the_user(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = saved_numbers(tmp_path / "vector.safetensors")
    made.mask = "rules"
    save_weights(tmp_path / "vector.safetensors", made, {})
    main(["vector.safetensors", "vector.onnx", "target=5"])
    said = capsys.readouterr().out
    assert "the same actions" in said
    assert said.endswith("under the mask rules, which is left to you: evaluate vector.onnx+rules\n")


def test_a_model_that_does_not_pass_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    saved_numbers(tmp_path / "policy.safetensors")
    (tmp_path / "q.onnx").write_text("mine")
    onnx_policy = export.onnx_policy

    def other(*given: Any) -> object:
        policy, look = onnx_policy(*given)
        return lambda step: policy(step).set("action", (step["action"] + 1) % 7), look

    monkeypatch.setattr(export, "onnx_policy", other)
    error = refused(capsys, main, "policy.safetensors", "q.onnx", "target=4")
    assert "ship_trl: onnxruntime: chooses other actions than the network" in error
    assert (tmp_path / "q.onnx").read_text() == "mine" and len(list(tmp_path.iterdir())) == 2


REFUSED = {
    "": "the following arguments are required: POLICY, FILE.onnx; see ",
    "policy.safetensors q.pt target=4": "file: must be a name that ends with .onnx, got q.pt",
    "policy.safetensors q.onnx": "target: none given for policy.safetensors; allowed: target=CASE",
    "policy.safetensors q.onnx target=2,4": "policy: policy.safetensors has several results or cases;",
    "random q.onnx target=4": "policy: random has no network; allowed: a result folder or a safetensors file",
}


@pytest.mark.parametrize("line", REFUSED)
def test_wrong_input_is_one_line(line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved(tmp_path / "policy.safetensors")
    assert refused(capsys, main, *line.split()).startswith(f"ship_trl: {REFUSED[line]}")
    assert [path.name for path in tmp_path.iterdir()] == ["policy.safetensors"]
