"""Let Stable-Baselines3 act: its own loader reads a saved model, in a process of its own.

The file holds pickles, which run code as they are loaded. So we read nothing of it, send numbers and get
numbers. `python -m ship_trl.policies.sb3 FILE` is the other process.
"""

from __future__ import annotations

import atexit
import importlib.util
import json
import math
import os
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.network import load_network
from ship_trl.config.types import Network
from ship_trl.transfer.weights import COLOURS, Look

if TYPE_CHECKING:
    from ship_trl.sim.env import ShipEnv

# Bytes of the number of observations that follow, and the type of the actions that come back.
COUNT, ACTION = 4, np.dtype(np.int64)
# What the numbers were before they told of encounters.
OLDER = Network(linear=[1], ships=3)
# Of training alone: a whole replay, and functions that another Python may not unpickle.
UNUSED = {"buffer_size": 1, "learning_rate": 0.1, "lr_schedule": 0.1, "clip_range": 0.1, "clip_range_vf": 0.1}


def sb3_policy(path: Path, env: ShipEnv) -> tuple[TensorDictSequential, Look]:
    """Load a model as a policy of two modules: one observes states, the other acts; and what it observes.

    Pixels have no speed vectors: the file does not say with which it was trained.

    Raises:
        ConfigError: Stable-Baselines3 is not installed or cannot load the file, or the model has other
            observations or actions.
    """
    if importlib.util.find_spec("stable_baselines3") is None:
        missing = "stable_baselines3, which is not installed; run: pip install stable-baselines3"
        raise ConfigError(f"policy: {path} needs {missing}")
    process, about = start(path, path.stat().st_mtime_ns)
    if "error" in about:
        raise ConfigError(f"policy: {path}: stable_baselines3 cannot load it ({about['error']})")
    shape, numbers = tuple(about["shape"]), load_network("vector")
    seen = load_network() if len(shape) > 1 else numbers if shape == (numbers.inputs,) else OLDER
    look = Look(seen, colour=COLOURS in shape)
    wanted = "float32" if seen.linear else "uint8", len(env.world.actions)
    if sorted(shape) != sorted(look.shape) or (about["dtype"], about["actions"]) != wanted:
        allowed = f"observations of ShipCollision-v0 and {wanted[1]} actions"
        got = f"{about['dtype']} {list(shape)} and {about['actions']}"
        raise ConfigError(f"policy: {path}: must have {allowed}, got {got}")

    def act(observed: Tensor) -> Tensor:
        ordered = observed if observed.shape[1:] == shape else observed.movedim(1, -1)
        count, answer = len(ordered), b""
        with suppress(OSError):
            process.stdin.write(
                count.to_bytes(COUNT, "little") + ordered.cpu().contiguous().numpy().tobytes()
            )
            process.stdin.flush()
            answer = process.stdout.read(ACTION.itemsize * count)
        if len(answer) != ACTION.itemsize * count:
            raise ConfigError(f"policy: {path}: its process has ended")
        return torch.from_numpy(np.frombuffer(answer, ACTION).copy()).to(env.device)

    observe = TensorDictModule(env.observer(*look[:2]), in_keys=["state"], out_keys=[look.observes])
    acts = TensorDictModule(act, in_keys=[look.observes], out_keys=["action"])
    return TensorDictSequential(observe, acts), look


@cache
def start(path: Path, _changed: int) -> tuple[Any, dict[str, Any]]:
    """Start the process of a file, again if it has changed; return it, and what it says of its model."""
    print_error(f"policy: {path}: running the code in it, in a process of its own")
    words = [sys.executable, "-W", "ignore", "-m", "ship_trl.policies.sb3", str(path.absolute())]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    atexit.register(process.kill)
    assert process.stdout is not None
    line = process.stdout.readline()
    return process, json.loads(line) if line else {"error": "its process has ended"}


def serve(path: str) -> None:
    """Say what a model observes, then answer batches of observations with actions."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what the model's code prints is no answer
    try:
        model = load_model(path)
        space, actions = model.observation_space, int(model.action_space.n)
        about = {"shape": list(space.shape), "dtype": str(space.dtype), "actions": actions}
    except Exception as error:  # a pickle may raise anything
        about = {"error": f"{type(error).__name__}: {error}"}
    answers.write(json.dumps(about).encode() + b"\n")
    while "error" not in about and (count := int.from_bytes(sys.stdin.buffer.read(COUNT), "little")):
        size = count * math.prod(space.shape) * space.dtype.itemsize
        batch = np.frombuffer(sys.stdin.buffer.read(size), space.dtype).reshape(count, *space.shape)
        action, _ = model.predict(batch, deterministic=True)
        answers.write(np.asarray(action, ACTION).tobytes())


def load_model(path: str) -> Any:
    """Load a model on the CPU. Its file does not name its algorithm: policy and settings tell it."""
    import stable_baselines3
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.save_util import load_from_zip_file
    from stable_baselines3.dqn.policies import DQNPolicy

    torch.set_num_threads(1)
    data: Any = load_from_zip_file(path, device="cpu", custom_objects=UNUSED)[0]
    policy, kind = data["policy_class"], "PPO" if "clip_range" in data else "A2C"
    if issubclass(policy, DQNPolicy):
        kind = "DQN"
    elif not issubclass(policy, ActorCriticPolicy):
        raise ValueError(f"{policy.__name__}; allowed: models of DQN, PPO and A2C")
    return getattr(stable_baselines3, kind).load(path, device="cpu", custom_objects=UNUSED)


if __name__ == "__main__":
    serve(sys.argv[1])
