"""Convert a network to ONNX, and compare the model with it on an episode."""

from __future__ import annotations

import importlib.util
import json
import logging
import warnings
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ship_trl import __version__
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import describe_network
from ship_trl.fast.worlds import make_env
from ship_trl.files.disk import atomic_write
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode, greedy_policy, rollout
from ship_trl.policies.named import load_network, load_with_network
from ship_trl.policies.onnx import OUTPUT, RUNTIME, onnx_policy
from ship_trl.policies.registry import Entry, split_suites
from ship_trl.transfer.weights import open_safetensors

# Maximum error of Q-values relative to the largest; summing float32 in another order gives less.
TOLERANCE = 1e-4


def export(entry: Entry, path: Path) -> str:
    """Write a network as ONNX, and check it if onnxruntime is installed; return what was written.

    The model gives Q-values, without the mask under which the network may have been trained.

    Raises:
        ConfigError: the policy has no network, or the model's actions or Q-values differ from the network's.
    """
    # In a suite it is checked in the first scene.
    entry = split_suites([entry])[0]
    env = make_env(entry.suite.case, entry.world, colour=entry.colour)
    weights = Path(entry.policy)
    is_file = weights.suffix == ".safetensors"
    network = load_network(weights, env) if is_file else load_with_network(entry.policy, env)[1]
    observe = env.observer(network.config, network.colour)
    # The exporter would treat a batch size of one as constant.
    observation = observe(env.reset()["state"].expand(2, -1))
    program = trace(network, observation)
    # The case, the actions, the layers, and the run that trained the weights.
    about = {
        "case": entry.suite.case.name,
        "policy": entry.label,
        "actions": json.dumps(entry.world.actions),
        "actions_unit": "m/s, rad/s",
        "ship_trl": __version__,
    }
    if is_file:
        with open_safetensors(weights, "policy") as file:
            trained = json.loads((file.metadata() or {}).get("ship_trl", "{}"))
        about |= {key: str(trained[key]) for key in ("config_hash", "episode") if key in trained}
    about["network"] = json.dumps(describe_network(network.config))
    about |= {"mask": network.mask} if network.mask else {}
    program.model.metadata_props.update(about)
    kind, size = str(observation.dtype).removeprefix("torch."), ", ".join(map(str, observation.shape[1:]))
    actions = len(entry.world.actions)
    shapes = f"{network.observes} {kind} [batch, {size}] -> {OUTPUT} float32 [batch, {actions}]"
    with atomic_write(path) as draft:
        program.save(draft)
        checked = f"not checked: {RUNTIME} is not installed"
        if importlib.util.find_spec(RUNTIME) is not None:
            policies = greedy_policy(network, observe), onnx_policy(draft, env)[0]
            checked = compare(*(rollout(env, policy)[0] for policy in policies))
    if network.mask:
        checked += (
            f"\ntrained under the mask {network.mask}, which is left to you: evaluate {path}+{network.mask}"
        )
    return f"{path}: case {entry.suite.case.name}, {entry.label}; {shapes}\n{checked}"


def trace(network: DuelingNetwork, observation: Tensor) -> Any:
    """Return the network as an ONNX program that accepts any batch size, from an example of two rows."""

    class QValues(nn.Module):
        """The network without its backend, whose branches cannot be exported."""

        def __init__(self) -> None:
            super().__init__()
            self.network = network

        def forward(self, observed: Tensor) -> Tensor:
            return self.network.dense_q_values(observed)

    # The exporter logs that torchvision is missing, which is not needed, and warns about its own calls.
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return torch.onnx.export(
            QValues().eval(),
            (observation,),
            dynamo=True,
            verbose=False,
            input_names=[network.observes],
            output_names=[OUTPUT],
            dynamic_shapes={"observed": {0: torch.export.Dim("batch")}},
        )


def compare(network: Episode, onnx: Episode) -> str:
    """Compare the greedy episodes of a network and its model; return the line to print.

    Raises:
        ConfigError: actions differ, or Q-values differ by more than `TOLERANCE`.
    """
    assert network.q_values is not None and onnx.q_values is not None
    if network.actions.tolist() != onnx.actions.tolist():
        raise ConfigError(f"{RUNTIME}: chooses other actions than the network; nothing written")
    difference = float((network.q_values - onnx.q_values).abs().max())
    largest = float(network.q_values.abs().max())
    found = f"Q-values of up to {largest:.3g} differ by at most {difference:.1e}"
    if not difference <= TOLERANCE * largest:
        raise ConfigError(f"{RUNTIME}: {found}, allowed {TOLERANCE * largest:.1e}; nothing written")
    return f"checked in {RUNTIME} on an episode of {network.length} steps: the same actions, {found}"
