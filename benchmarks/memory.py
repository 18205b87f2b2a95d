"""Bytes of a replay beside Stable-Baselines3's, and of a whole run."""

from __future__ import annotations

import gc
import subprocess
import sys
import tempfile
import types
from pathlib import Path

import gymnasium
import numpy as np
import torch
from stable_baselines3.common.buffers import ReplayBuffer

from benchmarks.ours import make_ours
from benchmarks.timing import Measurement
from benchmarks.work import FRAME

ROOT = Path(__file__).resolve().parents[1]
TRANSITIONS = 50_000
# Enough for updates, evaluations, pictures and GIF of a short run.
EPISODES = 20
# Their attributes are code, not what an object holds.
CODE_TYPES = (type, types.ModuleType, types.FunctionType, types.MethodType)
# Not `ru_maxrss`: that starts at what the parent process had.
RUN = """
import atexit, pathlib, re, sys
def print_peak():
    status = pathlib.Path("/proc/self/status")
    found = re.search(r"VmHWM:\\s*(\\d+)", status.read_text()) if status.exists() else None
    print("peak", 1024 * int(found[1]) if found else 0)
atexit.register(print_peak)
from ship_trl.__main__ import main
main()
"""


def held_bytes(*roots: object) -> int:
    """Return the bytes of all tensors and arrays that objects hold, shared memory counted once."""
    seen, waiting, total = set(), list(roots), 0
    while waiting:
        value = waiting.pop()
        if isinstance(value, torch.Tensor):
            value = value.untyped_storage()
        identity = value.data_ptr() if isinstance(value, torch.UntypedStorage) else id(value)
        if identity in seen or isinstance(value, CODE_TYPES):
            continue
        seen.add(identity)
        if isinstance(value, torch.UntypedStorage):
            total += value.nbytes()
        elif isinstance(value, np.ndarray):
            total += value.nbytes
        else:
            waiting += gc.get_referents(value)
    return total


def measure_replays(transitions: int) -> list[Measurement]:
    """Measure full replays, ours with what it needs to draw the pixels."""
    group, found = f"replay of {transitions:,}", []
    for arm, kept in (("scratch", "states"), ("FE4", "200 features"), ("FE3", "3,136 features")):
        ours = make_ours(arm, f"learn.replay_size={transitions}")
        # Transitions are stored when somebody counts them; the first one allocates the whole storage.
        ours.fill(ours.learn.num_envs)
        assert len(ours.replay) > 0
        size = held_bytes(ours.replay, ours.parts.draw)
        found.append(Measurement(group, f"ours, {kept} ({arm})", "byte", [size]))
    pixels = gymnasium.spaces.Box(0, 255, FRAME, np.uint8)
    actions = gymnasium.spaces.Discrete(len(ours.run.config.world.actions))
    for name, once in (("SB3, pixels", False), ("SB3, pixels, each picture once", True)):
        # Quick, because NumPy's zeros take no memory before something is written.
        buffer = ReplayBuffer(
            transitions,
            pixels,
            actions,
            "cpu",
            optimize_memory_usage=once,
            handle_timeout_termination=not once,
        )
        found.append(Measurement(group, name, "byte", [held_bytes(buffer)]))
    return found


def measure_run(episodes: int) -> int:
    """Return the peak of resident bytes of a run of the profile quick, cut short; 0 outside Linux."""
    with tempfile.TemporaryDirectory() as folder:
        overrides = ["target=4", "method=scratch", f"learn.episodes={episodes}", "learn.warmup_steps=200"]
        done = subprocess.run(
            [sys.executable, "-c", RUN, *overrides, f"output={folder}"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        )
    return int(done.stdout.split()[-1])


def measure_memory() -> list[Measurement]:
    """Measure the replays and a whole run, libraries included."""
    found = measure_replays(TRANSITIONS)
    size = measure_run(EPISODES)
    return [*found, Measurement("run", "ours, profile quick", "byte", [size])]
