"""`python -m ship_trl export POLICY FILE.onnx [target=CASE]`: a network for ONNX, checked on a whole episode.

POLICY is a result folder (its best network, on its own target) or a safetensors file. The model has one
input, `pixels` uint8 [batch, C, 84, 84], and one output, `action_value` float32 [batch, A], the Q-values of
the actions, whose speeds and turns are in its metadata. It computes the network's function in float32. The
check needs onnxruntime; a model that does not pass is not written.
"""

from __future__ import annotations

import importlib.util
import json
import logging
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl import __version__
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_output, make_parser
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.config.types import PICTURE
from ship_trl.files.disk import replacing
from ship_trl.policies.entry import Entry
from ship_trl.run.entries import best_of_folders, find_entries

if TYPE_CHECKING:
    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.learn.rollout import Episode
    from ship_trl.sim.env import ShipEnv

NEEDED, CHECKING = ("onnx", "onnxscript"), "onnxruntime"
INPUT, OUTPUT = "pixels", "action_value"
# How far Q-values may be off, as a share of the largest: sums of float32 in another order differ by less.
TOLERANCE = 1e-4


def main(arguments: list[str] | None = None) -> None:
    """Export, check, say what was written."""
    parser = make_parser("export", __doc__)
    parser.add_argument("policy", metavar="POLICY", help="a result folder or a safetensors file")
    add_output(parser, "file", (".onnx",), "what is written")
    parser.add_argument(
        "target", nargs="?", metavar="target=CASE", help="what it sails; a folder brings its own"
    )
    parser.add_argument("--colour", action="store_true", help="the network of a file sees colours")
    options = parser.parse_args(arguments)
    with refusals():
        for name in NEEDED:
            if importlib.util.find_spec(name) is None:
                raise ConfigError(missing_extra(name, "onnx"))
        words = [options.policy, *([options.target] if options.target else [])]
        lines = export(find_entry(words, options.colour), options.file)
    sys.stdout.write("\n".join(lines) + "\n")


def find_entry(words: list[str], colour: bool) -> Entry:
    """Find the policy, on one case; of a result folder its best network.

    Raises:
        ConfigError: there is none, or several cases or results.
    """
    entries = best_of_folders(find_entries(words, colour))
    if len(entries) > 1:
        raise ConfigError(f"policy: {words[0]} has several results or cases; allowed: one of each")
    return entries[0]


def export(entry: Entry, path: Path) -> list[str]:
    """Write a network as ONNX, and check it where onnxruntime is installed; returns what to say of it.

    Raises:
        ConfigError: the policy has no network, or the model does not do what the network does.
    """
    from ship_trl.learn.rollout import rollout
    from ship_trl.policies.named import load_with_network
    from ship_trl.run.process import configure_process
    from ship_trl.sim.env import ShipEnv

    configure_process()
    env = ShipEnv(entry.case, entry.world, colour=entry.colour)
    policy, network = load_with_network(entry.policy, env)
    channels, actions = env.rasteriser.channels, len(entry.world.actions)
    program = trace(network, channels)
    program.model.metadata_props.update(about(entry))
    shapes = f"{INPUT} uint8 [batch, {channels}, {PICTURE}, {PICTURE}] -> {OUTPUT} float32 [batch, {actions}]"
    with replacing(path) as draft:
        program.save(draft)
        checked = f"not checked: {CHECKING} is not installed"
        if importlib.util.find_spec(CHECKING) is not None:
            checked = compare(rollout(env, policy)[0], rollout(env, onnx_policy(draft, env))[0])
    return [f"{path}: case {entry.case.name}, {entry.label}; {shapes}", checked]


def trace(network: DuelingNetwork, channels: int) -> Any:
    """Make an ONNX program of a network's function, for any number of pictures at once."""
    import torch
    from torch import Tensor, nn

    class QValues(nn.Module):
        """The network without a backend, whose work depends on the picture."""

        def __init__(self) -> None:
            super().__init__()
            self.network = network

        def forward(self, pixels: Tensor) -> Tensor:
            return self.network.dueling(self.network.convolve(pixels))

    # It tells of torchvision, which is not used, and warns of its own calls.
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return torch.onnx.export(
            QValues().eval(),
            # Two: a batch of one would be taken for a constant.
            (torch.zeros(2, channels, PICTURE, PICTURE, dtype=torch.uint8),),
            dynamo=True,
            verbose=False,
            input_names=[INPUT],
            output_names=[OUTPUT],
            dynamic_shapes={INPUT: {0: torch.export.Dim("batch")}},
        )


def about(entry: Entry) -> dict[str, str]:
    """Give a model's metadata: the case, what its actions are, and whose weights it has."""
    from ship_trl.transfer.layers import opened

    found = {
        "case": entry.case.name,
        "policy": entry.label,
        "actions": json.dumps(entry.world.actions),
        "actions_unit": "m/s, rad/s",
        "ship_trl": __version__,
    }
    if Path(entry.policy).is_file():
        with opened(Path(entry.policy), "policy") as file:
            header = json.loads((file.metadata() or {}).get("ship_trl", "{}"))
        found |= {key: str(header[key]) for key in ("config_hash", "episode") if key in header}
    return found


def onnx_policy(path: Path, env: ShipEnv) -> Any:
    """Make the policy that takes the action of the highest Q-value, computed by onnxruntime."""
    import onnxruntime
    import torch
    from tensordict import TensorDictBase

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])

    def policy(step: TensorDictBase) -> TensorDictBase:
        pixels = env.rasteriser(step["state"])
        values = torch.from_numpy(session.run([OUTPUT], {INPUT: pixels.numpy()})[0])
        return step.set(OUTPUT, values).set("action", values.argmax(-1))

    return policy


def compare(network: Episode, onnx: Episode) -> str:
    """Compare the episodes that a network and its ONNX model sail.

    Raises:
        ConfigError: they act differently, or their Q-values differ by more than rounding.
    """
    assert network.q_values is not None and onnx.q_values is not None
    if network.actions.tolist() != onnx.actions.tolist():
        raise ConfigError(
            f"{CHECKING}: acts differently on an episode of {network.length} steps; nothing written"
        )
    difference = float((network.q_values - onnx.q_values).abs().max())
    largest = float(network.q_values.abs().max())
    off = f"Q-values of up to {largest:.3g} differ by {difference:.1e} at most"
    if not difference <= TOLERANCE * largest:
        raise ConfigError(f"{CHECKING}: {off}, allowed {TOLERANCE * largest:.1e}; nothing written")
    return f"checked in {CHECKING} on an episode of {network.length} steps: the same actions, {off}"
