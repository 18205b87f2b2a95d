"""Let onnxruntime act: the greedy policy of a model that `export` wrote."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor

from ship_trl.config.errors import ConfigError, missing_extra, require
from ship_trl.config.network import geometry
from ship_trl.config.schema import read_as
from ship_trl.config.types import Network
from ship_trl.files.disk import read_file
from ship_trl.sim.env import ShipEnv
from ship_trl.transfer.weights import COLOURS, Look

RUNTIME = "onnxruntime"
OUTPUT = "action_value"
# The paper's network has 2 MB.
MAX_MODEL_BYTES = 1 << 28


def onnx_policy(path: Path, env: ShipEnv) -> tuple[TensorDictSequential, Look]:
    """Load a model as a policy of two modules: one observes states, the other acts; and what it observes.

    It is read into memory, so that it can name no other file.

    Raises:
        ConfigError: onnxruntime is not installed, or the file is not a model of `export` for these actions.
    """
    if importlib.util.find_spec(RUNTIME) is None:
        raise ConfigError(f"policy: {missing_extra(RUNTIME, 'onnx')}")
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 4  # what is wrong with a file is said below
    try:
        model = read_file(path, MAX_MODEL_BYTES)
        session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        about = json.loads(session.get_modelmeta().custom_metadata_map["network"])
        network = read_as(Network, about, key="network", from_json=True)
        geometry(network)  # refuses wrong ones
        ((key, shape),) = [(one.name, one.shape[1:]) for one in session.get_inputs()]
        ((output, actions),) = [(one.name, one.shape[1:]) for one in session.get_outputs()]
        look = Look(network, colour=not network.linear and shape[0] == COLOURS)
        wanted = [look.observes, [*look.shape], OUTPUT, [len(env.world.actions)]]
        got = [key, shape, output, actions]
        require(got == wanted, "input and output", f"{wanted}", got)
    except Exception as error:  # the runtime raises many kinds
        reason = " ".join(f"{error}".split())
        raise ConfigError(
            f"policy: {path} is not a model of ship-trl export for this world ({reason})"
        ) from None

    def act(observed: Tensor) -> tuple[Tensor, Tensor]:
        values = torch.from_numpy(session.run([OUTPUT], {key: observed.cpu().numpy()})[0]).to(env.device)
        return values, values.argmax(-1)

    observe = TensorDictModule(env.observer(network, look.colour), in_keys=["state"], out_keys=[key])
    acts = TensorDictModule(act, in_keys=[key], out_keys=[OUTPUT, "action"])
    return TensorDictSequential(observe, acts), look
