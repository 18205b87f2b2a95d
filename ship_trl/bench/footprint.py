"""What lies in memory, and how long a start takes."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import types
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3.common.buffers import ReplayBuffer
from tensordict import TensorDictBase

import ship_trl
from ship_trl.bench.ours import Ours
from ship_trl.bench.timing import Probe
from ship_trl.bench.work import FRAME, learn_config

TRANSITIONS = 50_000
# Of a run for its memory: enough for updates, evaluations, pictures and film.
EPISODES = 20
# They have attributes, but lead away from what an object holds.
NOT_DATA = (type, types.ModuleType, types.FunctionType, types.MethodType)


def held_bytes(thing: object, seen: set[int] | None = None) -> int:
    """Bytes of every tensor and array that an object holds: tensors by memory, arrays one by one."""
    seen = set() if seen is None else seen
    if isinstance(thing, torch.Tensor):
        storage = thing.untyped_storage()
        new = storage.data_ptr() not in seen
        seen.add(storage.data_ptr())
        return storage.nbytes() if new else 0
    if id(thing) in seen:
        return 0
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        return thing.nbytes
    if isinstance(thing, TensorDictBase):
        parts: list[Any] = list(thing.values(include_nested=True, leaves_only=True))
    elif isinstance(thing, Mapping):
        parts = list(thing.values())
    elif isinstance(thing, list | tuple | set):
        parts = list(thing)
    else:
        parts = [] if isinstance(thing, NOT_DATA) else list(getattr(thing, "__dict__", {}).values())
    return sum(held_bytes(part, seen) for part in parts)


def replay_memory(transitions: int = TRANSITIONS) -> dict[str, int]:
    """Bytes of replays for so many transitions; ours with all that it needs to draw them."""
    held = {}
    for arm, kept in (("scratch", "states"), ("FE4", "200 features"), ("FE3", "3,136 features")):
        ours = Ours(arm, learn=learn_config(replay_size=transitions))
        # The storage is allocated whole when the first transition is stored, which counting them does.
        ours.fill(ours.learn.num_envs)
        assert len(ours.replay) > 0
        held[f"ours, {kept} ({arm})"] = held_bytes([ours.replay, ours.agent.draw])
    pictures = gymnasium.spaces.Box(0, 255, FRAME, np.uint8)
    actions = gymnasium.spaces.Discrete(ours.num_actions)
    for name, thrifty in (("SB3, pixels", False), ("SB3, pixels, each picture once", True)):
        # NumPy's zeros take no memory before something is written, so this is quick.
        buffer = ReplayBuffer(
            transitions,
            pictures,
            actions,
            "cpu",
            optimize_memory_usage=thrifty,
            handle_timeout_termination=not thrifty,
        )
        held[name] = held_bytes(buffer)
    return held


def surroundings() -> dict[str, str]:
    """Return the environment in which another Python finds this package."""
    path = os.pathsep.join(
        filter(None, [str(Path(ship_trl.__file__).parents[1]), os.environ.get("PYTHONPATH")])
    )
    return os.environ | {"PYTHONPATH": path}


def python(*arguments: str) -> Callable[[], int]:
    """Start a Python of its own with this package, in the working directory."""

    def run() -> int:
        subprocess.run([sys.executable, *arguments], env=surroundings(), check=True, capture_output=True)
        return 1

    return run


def run_memory(episodes: int) -> int:
    """Most bytes resident in a training run of the profile quick, cut short, with a full-sized replay."""
    with tempfile.TemporaryDirectory() as folder:
        overrides = [f"learn.episodes={episodes}", "learn.warmup_steps=200", f"output={folder}"]
        process = subprocess.Popen(
            [sys.executable, "-m", "ship_trl", "target=4", "method=scratch", *overrides],
            env=surroundings(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        most = 0
        while process.poll() is None:
            most = max(most, peak_bytes(process.pid))
            time.sleep(0.05)
    if process.returncode != 0:
        raise RuntimeError("a run of the benchmark failed: python -m ship_trl target=4 method=scratch")
    return most


def peak_bytes(process: int) -> int:
    """Most bytes that a process had resident so far; 0 where the system does not tell.

    Not `ru_maxrss`: that begins with what the parent had when it made the process.
    """
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    sizes = [int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")]
    return sizes[0] if sizes else 0


def startup_probes() -> list[Probe]:
    """Probe starts of Python: help, and everything that a training imports."""
    return [
        Probe("import stable_baselines3", python("-c", "import stable_baselines3"), "start"),
        Probe("import ship_trl", python("-c", "import ship_trl.run.experiment"), "start", ours=True),
        Probe("python -m ship_trl --help", python("-m", "ship_trl", "--help"), "start", "help", ours=True),
    ]
