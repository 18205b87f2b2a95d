"""Train the bundled networks again: one for each bundled case, and those of random encounters."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.errors import ConfigError, override
from ship_trl.files.curve import RunError, split
from ship_trl.files.disk import atomic_write
from ship_trl.files.record import RunRecord, read_run
from ship_trl.policies.pretrained import CURVES, MANIFEST, CaseNetwork, SuiteNetwork, networks
from ship_trl.run.plan import ALGORITHM_VERSION
from ship_trl.sim.cases import Suite, load_case, load_suite, load_world, suite_of
from ship_trl.transfer.casebase import POLICY

if TYPE_CHECKING:
    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.learn.rollout import Episode

RUNS = Path("outputs/pretrained")
SEEDS, SCRATCH = range(100, 105), ("method=scratch",)
NUMBERS = "observation=vector", "network.linear=[256,256,512,256]"
# With payments a collision costs 110 in scaled rewards: a Huber threshold of 10 forgets rare ones, 50 fewer.
RULES = *NUMBERS, "learn.huber_delta=50"
# The networks of random encounters by name: seeds, the bundled one first, and words of their runs. With the
# rules, 1 and 3 solve the most of 1,000 scenes each of all suites traffic_*, but _test, of seed 777.
SUITES = {
    "traffic": (range(3), NUMBERS),
    "traffic_rules": ((1, 0, 2, 3, 4), (*RULES, "margin.rules=300", "margin.timeout=600")),
    # Its teacher is `traffic`, written before it.
    "traffic_pixels": (range(3), ("algorithm=pupil", "algorithm.teacher=traffic")),
}
TEACHER = "algorithm.teacher"
# The suites that their success rates are of. Equal episodes on the first allow half precision.
TESTS = ("imazu", "traffic_test")


def train(output: Path, seeds: Iterable[int], *words: str) -> None:
    """Train the missing runs, and exit if one fails."""
    grid = *words, f"seed={','.join(map(str, seeds))}", override("output", output)
    if code := subprocess.run([sys.executable, "-m", "ship_trl", "-m", *grid], check=False).returncode:
        sys.exit(code)


def make_cases(folder: Path, runs: Path) -> None:
    """Train the missing runs of cases; write each case's best network, all curves and last a manifest.

    Raises:
        ConfigError: a run is missing or incomplete.
        OSError: a file cannot be written.
    """
    import pandas as pd

    from ship_trl.policies.reference import best_known
    from ship_trl.run.process import configure_process

    world, cases = load_world(), sorted(one.target for one in networks())
    train(runs, SEEDS, *SCRATCH, f"target={','.join(cases)}")
    configure_process()
    written, kept, curves = [], [], []
    for case in (load_case(name, world) for name in cases):
        found = [read_trained(runs / case.name / "scratch" / f"seed={seed}") for seed in SEEDS]
        for run in found:
            about = {"case": run.target, "seed": run.seed, "config_hash": run.config_hash}
            kept.append(about | {"best_return": run.best.episode_return})
            rows = split(run.curve)[0][["episode", "return"]].round({"return": 2})
            curves.append(rows.assign(config_hash=run.config_hash))
        # On ties `max` finds the first, which has the lower seed.
        best = max(found, key=lambda run: run.best.episode_return)
        (whole,), _, values = write_weights(folder, case.name, best, suite_of(case))
        one = CaseNetwork(
            **values,
            fingerprint=case.fingerprint,
            episode_return=whole.episode_return,
            of_best_known=round(whole.episode_return / best_known(case, world).episode_return, 4),
            outcome=whole.outcome,
            length=whole.length,
            dcpa=whole.dcpa if math.isfinite(whole.dcpa) else None,
        )
        sys.stdout.write(
            f"case {one.name}: seed {one.seed}, return {one.episode_return:.1f}, "
            f"{one.of_best_known:.0%} of the best known, {one.outcome}, {one.dtype}\n"
        )
        written.append(asdict(one))
    with atomic_write(folder / CURVES) as draft:
        pd.concat(curves).to_csv(draft, index=False, lineterminator="\n")
    update_manifest(folder, algorithm_version=ALGORITHM_VERSION, networks=written, runs=kept)


def make_suites(folder: Path, runs: Path) -> None:
    """Train the missing runs of random encounters; write the first seed of each name and the manifest.

    One name follows the other, because a network that was just written teaches another.

    Raises:
        ConfigError: a run is missing or incomplete.
        OSError: a file cannot be written.
    """
    from ship_trl.run.process import configure_process

    configure_process()
    suites, written = {test: load_suite(test, load_world()) for test in TESTS}, []
    for name, (seeds, words) in SUITES.items():
        pairs = [word.partition("=")[::2] for word in words]
        given = [
            override(key, folder / f"{value}.safetensors") if key == TEACHER else f"{key}={value}"
            for key, value in pairs
        ]
        train(runs / name, seeds, *SCRATCH, "target=traffic", *given)
        found = {seed: read_trained(runs / name / "traffic" / "scratch" / f"seed={seed}") for seed in seeds}
        rates = {str(seed): run.best.success_rate for seed, run in found.items()}
        _, network, values = write_weights(folder, name, found[seeds[0]], suites[TESTS[0]])
        reached = {}
        for test, suite in suites.items():
            episodes, _ = rollout_greedy(suite, folder / f"{name}.safetensors")
            reached[test] = sum(episode.goal for episode in episodes) / len(episodes)
        one = SuiteNetwork(
            **values, observation=network.observes, success_rates=reached, success_rates_by_seed=rates
        )
        told = ", ".join(f"{rate:.1%} of {suite}" for suite, rate in reached.items())
        sys.stdout.write(f"{name}: seed {one.seed}, success in {told}, {one.dtype}\n")
        written.append(asdict(one))
    update_manifest(folder, suites=written)


def update_manifest(folder: Path, **values: Any) -> None:
    """Set keys of the manifest in `folder`, and leave others as they are."""
    path = folder / MANIFEST
    held = json.loads(path.read_text()) if path.exists() else {}
    with atomic_write(path) as draft:
        draft.write_text(json.dumps(held | values, indent=1) + "\n")


def read_trained(folder: Path) -> RunRecord:
    """Read a run with its curve, or raise a ConfigError."""
    try:
        run = read_run(folder)
        run.curve  # noqa: B018
        return run
    except RunError as error:
        raise ConfigError(f"runs: {folder}: {error}") from None


def write_weights(
    folder: Path, name: str, run: RunRecord, suite: Suite
) -> tuple[list[Episode], DuelingNetwork, dict[str, Any]]:
    """Write a run's network, in half precision if its greedy episodes on `suite` stay the same.

    Returns:
        These episodes, the network, and the values of the manifest that all networks have.
    """
    import torch

    from ship_trl.transfer.weights import save_weights

    file = folder / f"{name}.safetensors"
    about: dict[str, Any] = {key: getattr(run, key) for key in ("target", "arm", "seed", "config_hash")}
    about["name"] = name
    whole, network = rollout_greedy(suite, run.folder / POLICY)
    for dtype in (torch.float16, torch.float32):
        save_weights(file, network, about, dtype)
        stored, _ = rollout_greedy(suite, file)
        if all(torch.equal(one.actions, same.actions) for one, same in zip(whole, stored, strict=True)):
            break
    about["dtype"] = str(dtype).removeprefix("torch.")
    about["sha256"] = hashlib.sha256(file.read_bytes()).hexdigest()
    return whole, network, about


def rollout_greedy(suite: Suite, weights: Path) -> tuple[list[Episode], DuelingNetwork]:
    """Return the greedy episodes of the network in a file, one of each case, and the network."""
    from ship_trl.fast.worlds import make_env
    from ship_trl.learn.rollout import rollout
    from ship_trl.policies.named import load_with_network
    from ship_trl.sim.starts import Starts

    world = load_world()
    env = make_env(suite, world, starts=Starts(suite, world).states)
    policy, network = load_with_network(str(weights), env)
    return rollout(env, policy), network
