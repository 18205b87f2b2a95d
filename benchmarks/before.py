"""`python -m benchmarks before`: this build beside an earlier one, in turn, on one machine.

The earlier build is a worktree of a commit in a temporary folder. Both run with this Python and its packages,
each measurement in a process of its own. Only `run` installs what each build's lock names, from what is
committed. `learned` pays the reward of 53fcc0f.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch

from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive
from ship_trl.config.errors import ConfigError
from ship_trl.run.console import show
from ship_trl.run.process import processor_name
from ship_trl.study.statistics import permutation

COMMIT, ROOT = "53fcc0f", Path(__file__).parent.parent
PARTS = {
    "import": "Seconds to import the environment",
    "run": "Minutes of `make run`, of each build its own job, in a fresh clone, installation included",
    "loop": "Steps a second of the paper's training loop from pixels: case 4, batches of 32",
    "vector": "Seconds for 1,000 updates from numbers and their 16,000 steps, batches of 128",
    "numbers": "Minutes from numbers until shares of traffic_test are solved, each as in its `curves`",
    "pixels": "Minutes from pixels until shares of traffic_test are solved, the teacher of numbers included",
    "learned": "What the earlier build's schedule teaches from numbers, and half of today's, for its reward",
}
# Not measured unless they are named.
LONG = {"run", "learned"}
# What both builds call otherwise: a run of random encounters, its words, and training without evaluations.
PLAN = """
from benchmarks import curves
from benchmarks.ours import Ours
from ship_trl.run.process import configure_process
configure_process()
try:
    from benchmarks.ours import plan
except ImportError:
    from benchmarks.work import plan
run = getattr(curves, "RUN", ("target=traffic", "profile=traffic", "method=scratch", "observation=vector"))
def begin(*words):
    ours = Ours(plan(*words, "learn.evaluate_every=1000000", "learn.evaluate_episodes=1"))
    if hasattr(ours.training, "begin"):
        ours.training.begin()
    return ours
"""
# A learner's minutes to shares of traffic_test: what comes before its training, and after it.
MINUTES = f"""{PLAN}
from torch import Generator
from ship_trl.learn.rollout import rollout
from ship_trl.sim.cases import load_world
try:
    from ship_trl.fast.worlds import make_env, make_starts
    from ship_trl.sim.cases import load_suite
except ImportError:
    from ship_trl.sim.env import ShipEnv as make_env
    from ship_trl.sim.starts import make_starts
    from ship_trl.sim.suites import load_suite
curves.EVERY = 0.1
suite = load_suite("traffic_test", load_world())
starts = make_starts(suite, load_world()).balanced(len(suite.cases), Generator())
curve = curves.Curve("ours", SEED, 60.0, make_env(suite, load_world(), starts=starts))
read = lambda one: (one.minutes, one.success) if hasattr(one, "minutes") else (one[0], one[2])
record = lambda *given: curve.record(*given) and read(curve.points[-1])[1] < 0.97
"""
REACHED = """
to = lambda goal: next((minutes for minutes, success in map(read, curve.points) if success >= goal), math.inf)
print(json.dumps({f"to {goal:.0%}": to(goal) for goal in (0.9, 0.95, 0.97)}))
"""
# Each prints numbers by name as JSON in its last line. Both builds have all that it uses.
SCRIPTS = {
    "import": """
began = time.perf_counter()
from ship_trl.sim.env import ShipEnv
print(json.dumps({"import": time.perf_counter() - began}))
""",
    "run": """
import os, subprocess, sys, tempfile
del os.environ["PYTHONPATH"]
run = "make", f"PYTHON={sys.executable}", "run"
with tempfile.TemporaryDirectory() as fresh:
    subprocess.run(("git", "clone", "--quiet", ".", fresh), check=True)
    began = time.perf_counter()
    subprocess.run(run, cwd=fresh, check=True, stdout=subprocess.DEVNULL)
    print(json.dumps({"minutes": (time.perf_counter() - began) / 60}))
""",
    "loop": """
from benchmarks.ours import make_ours
from ship_trl.run.process import configure_process
configure_process()
found = {}
for arm in "scratch", "FE1", "FE2", "FE3", "FE4":
    ours = make_ours(arm)
    if hasattr(ours.training, "begin"):
        ours.training.begin()
    ours.train(ours.learn.warmup_steps + 200)
    began = time.perf_counter()
    ours.train(1000)
    found[arm] = 1000 / (time.perf_counter() - began)
print(json.dumps(found))
""",
    "vector": PLAN
    + """
same = "learn.num_envs=64", "learn.update_every=16", "learn.batch_size=128", "learn.replay_size=200000"
ours = begin(*run, *same)
ours.train(20_000)
done, began = ours.algorithm.updates, time.perf_counter()
ours.train(20_000)
print(json.dumps({"seconds": (time.perf_counter() - began) / (ours.algorithm.updates - done) * 1000}))
""",
    "numbers": MINUTES + "curves.train_ours(SEED, record)" + REACHED,
    "pixels": MINUTES
    + """
import tempfile
from pathlib import Path
try:
    from ship_trl.transfer.weights import save_weights
except ImportError:
    from ship_trl.transfer.layers import save_weights
curves.EVERY = 0.5
short = [[getattr(curves, name)] if hasattr(curves, name) else [] for name in ("TEACHER", "PUPIL")]
teacher, began = begin(*run, f"seed={SEED}", *short[0]), time.process_time()
while not teacher.training.is_finished:
    for _ in teacher.training.advance():
        pass
spent = (time.process_time() - began) / 60
print(f"teacher: {spent:.1f} minutes", flush=True)
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder, "teacher.safetensors")
    save_weights(file, teacher.algorithm.network, {})
    ours = begin(*run[:3], "algorithm=pupil", f"algorithm.teacher={file}", f"seed={SEED}", *short[1])
while record(ours.algorithm.greedy, ours.training.steps, ours.training.is_finished):
    for _ in ours.training.advance():
        pass
curve.points = [(spent + read(point)[0], 0, read(point)[1]) for point in curve.points]
"""
    + REACHED,
    # On scenes that neither network has met, nor any choice of a schedule.
    "learned": MINUTES
    + """
import torch
learner, began = begin(*run, f"seed={SEED}", *getattr(curves, "SAME_REWARD", ())), time.process_time()
while not learner.training.is_finished:
    for _ in learner.training.advance():
        pass
minutes = (time.process_time() - began) / 60
suite = load_suite(run[0].partition("=")[2], load_world())
drawn = [make_starts(suite, load_world()).sample(1, Generator().manual_seed(30_000 + k)) for k in range(500)]
episodes = rollout(make_env(suite, load_world(), starts=torch.cat(drawn)), learner.algorithm.greedy)
means = {name: sum(getattr(one, name) for one in episodes) / 500 for name in ("goal", "episode_return")}
print(json.dumps({"minutes": minutes, **means}))
""",
}


def main(arguments: Sequence[str]) -> None:
    """Measure the parts with both builds, and print their tables."""
    listed = "\n".join(f"    {part:10} {title}" for part, title in PARTS.items())
    parser = make_parser("", f"{__doc__}\n\nParts:\n{listed}")
    parser.prog = "python -m benchmarks before"
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"default: all but {' and '.join(sorted(LONG))}"
    )
    parser.add_argument("--commit", default=COMMIT, help=f"the earlier build (default {COMMIT})")
    add_number(parser, "--rounds", Positive, 5, "measurements of each build, or seeds (default 5)")
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(arguments)
    for part in options.parts:
        if part not in PARTS:
            raise ConfigError(f"benchmarks before: no part {part}; allowed: {', '.join(PARTS)}")
    sys.stdout.write(f"{processor_name()}, torch {torch.__version__}, 1 thread\n")
    with worktree(options.commit) as before:
        builds = {options.commit: before, "this build": ROOT}
        for part in options.parts or [one for one in PARTS if one not in LONG]:
            # Compiles the loops, so that this is not counted as training.
            if warm := {"numbers": "vector", "learned": "vector", "pixels": "loop"}.get(part):
                for folder in builds.values():
                    measure(warm, folder, 0)
            rounds = [
                {name: measure(part, folder, seed) for name, folder in builds.items()}
                for seed in range(1, options.rounds + 1)
            ]
            print_ratios(PARTS[part], rounds, options.markdown, test=part == "learned")


@contextmanager
def worktree(commit: str) -> Iterator[Path]:
    """Check a commit out in a temporary folder, and remove it at the end.

    Raises:
        ConfigError: the checkout has no such commit.
    """
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / commit
        git = "git", "-C", str(ROOT), "worktree"
        made = subprocess.run(
            [*git, "add", "--detach", str(folder), commit], check=False, capture_output=True, text=True
        )
        if made.returncode:
            raise ConfigError(f"--commit: {made.stderr.strip()}; allowed: a commit of {ROOT}")
        try:
            yield folder
        finally:
            subprocess.run([*git, "remove", "--force", str(folder)], check=True)


def measure(part: str, folder: Path, seed: int) -> dict[str, float]:
    """Run the script of a part with the build in a folder; return its numbers."""
    script = f"import json, math, time\nSEED = {seed}\n{SCRIPTS[part]}"
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    environment = os.environ | {"PYTHONPATH": str(folder), "MPLBACKEND": "agg"} | threads
    command = [sys.executable, "-P", "-c", script]
    done = subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    sys.stdout.write(f"{folder.name}, {part}, round {seed}: {done.stdout.splitlines()[-1]}\n")
    sys.stdout.flush()
    return found


def print_ratios(
    title: str, rounds: list[dict[str, dict[str, float]]], markdown: bool, test: bool = False
) -> None:
    """Print the median and range of both builds, and the median of the rounds' ratios.

    With `test`, also the two-sided p-value of equal means, by permutation.
    """
    first, second = rounds[0]
    rows = []
    for name in rounds[0][first]:
        # A goal that one of both did not reach tells nothing about a ratio.
        reached = [one for one in rounds if all(math.isfinite(one[build][name]) for build in (first, second))]
        values = [[one[build][name] for one in reached] for build in (first, second)]
        if not reached:
            rows.append([name, "in no round by both", "", "", *[""] * test])
            continue
        counted = "" if len(reached) == len(rounds) else f", {len(reached)} of {len(rounds)} rounds"
        told = [f"{statistics.median(v):.3g} ({min(v):.3g} to {max(v):.3g})" for v in values]
        ratio = statistics.median(new / old for old, new in zip(*values, strict=True))
        p = ["-"] * test
        if test and len(reached) > 1:
            p = [f"{permutation(np.array(values[0]), np.array(values[1]), seed=0):.2g}"]
        rows.append([name + counted, *told, f"{ratio:.2f}", *p])
    show((title, first, second, "ratio", *["p"] * test), rows, markdown)
