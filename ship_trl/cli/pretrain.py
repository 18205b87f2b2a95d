"""`python -m ship_trl pretrain FOLDER`: train the bundled networks, one for each bundled case.

Seeds 100 to 104 learn each case from scratch with profile=quick. The network with the highest greedy return
is kept, on ties the one with the lower seed. It is written in half precision if its greedy episode stays the
same. Finished runs are not repeated.
"""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import CurveError, read_curve, split
from ship_trl.files.disk import atomic_write
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.policies.pretrained import CURVES, MANIFEST, Pretrained, networks
from ship_trl.run.plan import ALGORITHM_VERSION
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.transfer.casebase import POLICY

if TYPE_CHECKING:
    import pandas as pd

    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.learn.rollout import Episode

SEEDS, RUNS = range(100, 105), Path("outputs/pretrained")


def main(arguments: list[str] | None = None) -> None:
    """Run the missing trainings of the bundled cases, then choose and write the networks."""
    parser = make_parser("pretrain", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where networks and manifest are written")
    folder = parser.parse_args(arguments).folder
    cases = sorted(one.case for one in networks())
    grid = f"target={','.join(cases)}", "method=scratch", f"seed={','.join(map(str, SEEDS))}"
    line = [sys.executable, "-m", "ship_trl", "-m", *grid, f"output={RUNS}"]
    if code := subprocess.run(line, check=False).returncode:
        sys.exit(code)
    with refusals():
        write_networks(folder, [RUNS / case / "scratch" for case in cases])


def write_networks(folder: Path, cases: list[Path]) -> None:
    """Write the best network of each case, the curves of all runs and last a manifest into `folder`.

    `cases` are the folders of each case's runs.

    Raises:
        ConfigError: a run is missing or incomplete.
        OSError: a file cannot be written.
    """
    import numpy as np
    import pandas as pd

    from ship_trl.run.process import configure_process

    configure_process()
    folder.mkdir(parents=True, exist_ok=True)
    networks, runs, curves = [], [], []
    for place in cases:
        paths = [place / f"seed={seed}" for seed in SEEDS]
        found = [read_run(path) for path in paths]
        for result, training in found:
            about = {"case": result.target, "seed": result.seed, "config_hash": result.config_hash}
            runs.append(about | {"best_return": result.best.episode_return})
            rows = training[["episode", "return"]].round({"return": 2})
            curves.append(rows.assign(config_hash=result.config_hash))
        # On ties `argmax` finds the first, which has the lower seed.
        best = int(np.argmax([result.best.episode_return for result, _ in found]))
        one = write_network(folder, found[best][0], paths[best] / POLICY)
        sys.stdout.write(
            f"case {one.case}: seed {one.seed}, return {one.episode_return:.1f}, "
            f"{one.of_best_known:.0%} of the best known, {one.outcome}, {one.dtype}\n"
        )
        networks.append(one)
    with atomic_write(folder / CURVES) as draft:
        pd.concat(curves).to_csv(draft, index=False, lineterminator="\n")
    manifest = {
        "algorithm_version": ALGORITHM_VERSION,
        "networks": [asdict(one) for one in networks],
        "runs": runs,
    }
    with atomic_write(folder / MANIFEST) as draft:
        draft.write_text(json.dumps(manifest, indent=1) + "\n")


def read_run(run: Path) -> tuple[Result, pd.DataFrame]:
    """Read a run's result and its training episodes.

    Raises:
        ConfigError: a file is missing, damaged or incomplete.
    """
    try:
        return read_result(run), split(read_curve(run))[0]
    except (ResultError, CurveError) as error:
        what = f"{RESULT} {error}" if isinstance(error, ResultError) else error
        raise ConfigError(f"runs: {run}: {what}") from None


def write_network(folder: Path, result: Result, weights: Path) -> Pretrained:
    """Write the best network of a run as `CASE.safetensors`; return its entry in the manifest."""
    import torch

    from ship_trl.policies.reference import best_known
    from ship_trl.transfer.layers import save_weights

    world = load_world()
    case = load_case(result.target, world)
    file = folder / f"{case.name}.safetensors"
    about: dict[str, Any] = {key: getattr(result, key) for key in ("arm", "seed", "config_hash")}
    about["case"] = case.name
    whole, network = rollout_greedy(case, weights)
    for dtype in (torch.float16, torch.float32):
        save_weights(file, network, about, dtype)
        if torch.equal(rollout_greedy(case, file)[0].actions, whole.actions):
            break
    return Pretrained(
        **about,
        fingerprint=case.fingerprint,
        episode_return=whole.episode_return,
        of_best_known=round(whole.episode_return / best_known(case, world).episode_return, 4),
        outcome=whole.outcome,
        length=whole.length,
        dcpa=whole.dcpa if math.isfinite(whole.dcpa) else None,
        dtype=str(dtype).removeprefix("torch."),
        sha256=hashlib.sha256(file.read_bytes()).hexdigest(),
    )


def rollout_greedy(case: Case, weights: Path) -> tuple[Episode, DuelingNetwork]:
    """Return the greedy episode of the network in a file, and the network."""
    from ship_trl.learn.rollout import rollout
    from ship_trl.policies.named import load_with_network
    from ship_trl.sim.env import ShipEnv

    env = ShipEnv(case, load_world())
    policy, network = load_with_network(str(weights), env)
    return rollout(env, policy)[0], network
