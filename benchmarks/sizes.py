"""Bytes of a replay beside Stable-Baselines3's, of a whole run, and what a checkpoint costs."""

from __future__ import annotations

import gc
import re
import subprocess
import sys
import tempfile
import time
import types
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import torch
from stable_baselines3.common.buffers import ReplayBuffer

from benchmarks.ours import FRAME, Ours, make_ours, plan_run
from benchmarks.timing import Measurement
from ship_trl.run.checkpoint import Checkpoints
from ship_trl.run.history import to_row
from ship_trl.run.plan import CHECKPOINTS

ROOT = Path(__file__).resolve().parents[1]
TRANSITIONS = 50_000
# Whose checkpoints are measured.
SAVED_ARMS = ("scratch", "FE3", "FE4")
# Enough for updates, evaluations, pictures and GIF of a short run.
EPISODES = 20
# Their attributes are code, not what an object holds.
CODE_TYPES = (type, types.ModuleType, types.FunctionType, types.MethodType)
# Linux says how much was resident at most. `ru_maxrss` would begin with what the parent process had.
RUN = "from ship_trl.__main__ import main; main(); print(open('/proc/self/status').read())"


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
        size = held_bytes(ours.replay, ours.parts.algorithm.draw)
        found.append(Measurement(group, f"ours, {kept} ({arm})", "byte", [size]))
    pixels = gymnasium.spaces.Box(0, 255, FRAME, np.uint8)
    actions = gymnasium.spaces.Discrete(len(ours.run.config.world.actions))
    # Quick, because NumPy's zeros take no memory before something is written.
    buffer = partial(ReplayBuffer, transitions, pixels, actions, "cpu")
    once = buffer(optimize_memory_usage=True, handle_timeout_termination=False)
    return [
        *found,
        Measurement(group, "SB3, pixels", "byte", [held_bytes(buffer())]),
        Measurement(group, "SB3, pixels, each picture once", "byte", [held_bytes(once)]),
    ]


def measure_memory() -> list[Measurement]:
    """Measure the replays, and the peak of resident bytes of a run of profile quick, cut short."""
    found = measure_replays(TRANSITIONS)
    with tempfile.TemporaryDirectory() as folder:
        overrides = ["target=4", "method=scratch", f"learn.episodes={EPISODES}", "learn.warmup_steps=200"]
        command = [sys.executable, "-c", RUN, *overrides, f"output={folder}"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    (kilobytes,) = re.findall(r"VmHWM:\s*(\d+)", done.stdout)
    return [*found, Measurement("run", "ours, profile quick", "byte", [1024.0 * int(kilobytes)])]


def measure_checkpoints(rounds: int, seconds: float, *overrides: str) -> list[Measurement]:
    """Measure checkpoints of a run with a full replay, for every arm.

    Args:
        rounds: how many checkpoints are written.
        seconds: how long the run trains before each of them.
        overrides: of the paper's profile.
    """
    found = []
    for arm in SAVED_ARMS:
        with tempfile.TemporaryDirectory() as folder:
            no_wait = ("learn.warmup_steps=0", f"output={folder}")
            found += measure_arm(arm, Ours(plan_run(arm, no_wait + overrides)), rounds, seconds)
    # A group compares the arms in one quantity.
    return sorted(found, key=lambda one: (one.unit != "s", one.group != "write"))


def measure_arm(arm: str, ours: Ours, rounds: int, seconds: float) -> list[Measurement]:
    """Train and write a checkpoint in turns, then read the last one."""
    ours.fill(ours.learn.replay_size)
    (ours.run.folder / CHECKPOINTS).mkdir(parents=True)
    checkpoints = Checkpoints(ours.run, ours.parts, time.perf_counter())
    for event in ours.training.advance():
        ours.parts.history.add(to_row(event), ours.algorithm.network)
    writes = []
    for _ in range(rounds):
        # As in a run, the processor's caches then hold the training's numbers, not the checkpoint's.
        start = time.perf_counter()
        while time.perf_counter() - start < seconds:
            ours.train(1)
        start = time.perf_counter()
        checkpoints.write()
        writes.append(time.perf_counter() - start)
    sizes = [float(path.stat().st_size) for path in (ours.run.folder / CHECKPOINTS).iterdir()]
    again = Ours(ours.run)
    start = time.perf_counter()
    Checkpoints(ours.run, again.parts, start).resume()
    read = time.perf_counter() - start
    return [
        Measurement("write", arm, "s", writes),
        Measurement("read", arm, "s", [read]),
        Measurement(f"{len(sizes)} on the disk", arm, "byte", [sum(sizes)]),
    ]
