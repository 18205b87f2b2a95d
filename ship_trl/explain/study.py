"""`python -m ship_trl layers FOLDER TABLE`: how alike the layers of a study's networks are.

It looks at the best networks of the pairs' runs while they are there, for the tables that are kept of a study
hold none. TABLE is a CSV, to which the seeds are added that it lacks; called layers.csv and beside those
tables, the report draws it. A number is the CKA (`explain/cka.py`) of a layer of two networks, over states of
the target case that are the same for every seed and arm.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import is_name
from ship_trl.files.result import Result, ResultError, read_result
from ship_trl.policies.pretrained import PRETRAINED
from ship_trl.run.entries import settings_of
from ship_trl.sim.cases import load_case
from ship_trl.study.plan.jobs import PAIRS, run_folder
from ship_trl.study.plan.manifest import PLAN, read_plan
from ship_trl.study.records.layers import (
    OTHER_SEED,
    SCRATCH,
    SOURCE,
    UNTRAINED,
    Layer,
    read_layers,
    write_layers,
)
from ship_trl.transfer.casebase import POLICY

if TYPE_CHECKING:
    from torch import Tensor

    from ship_trl.explain.cka import Floats
    from ship_trl.learn.network import DuelingNetwork

# Ten states are taken of each episode; half of them are sailed at random, half by the packaged network.
EPISODES, STATES_SEED = 60, 0
# Folders of runs by arm.
Runs = dict[str, Path]


def add_seeds(folder: Path, path: Path) -> None:
    """Measure the seeds that the table lacks and whose networks are all there; it is written after each.

    Raises:
        ConfigError: the folder holds no study, or no seed is whole, or the table is none.
    """
    rows = read_layers(path) if path.exists() else []
    done = {row.seed for row in rows}
    whole = {seed: pairs for seed, pairs in sorted(places(folder).items()) if is_whole(pairs)}
    for seed in whole:
        if seed in done:
            continue
        begun = time.monotonic()
        found = []
        for pair, runs in whole[seed].items():
            before = [s for s, pairs in whole.items() if s < seed and SCRATCH in pairs.get(pair, {})]
            found += of_pair(seed, pair, runs, whole[before[-1]][pair] if before else {})
        rows += found
        done.add(seed)
        write_layers(path, rows)
        sys.stdout.write(f"seed {seed}: {len(found)} numbers, {time.monotonic() - begun:.0f} s\n")
        sys.stdout.flush()
    if not done:
        raise ConfigError(f"folder: {folder} has no seed with the networks of all arms of the pairs")
    sys.stdout.write(f"{len(done)} seeds; {path}\n")


def places(folder: Path) -> dict[int, dict[str, Runs]]:
    """Find where the runs of a study's pairs lie, by seed, pair and arm.

    Raises:
        ConfigError: the folder holds no study.
    """
    found: dict[int, dict[str, Runs]] = defaultdict(lambda: defaultdict(dict))
    for job in read_plan(folder / PLAN, "folder")["jobs"]:
        if job["part"] != PAIRS:
            continue
        if not (is_name(job["label"]) and is_name(job["arm"])):
            raise ConfigError(f"folder: {folder / PLAN} has a pair or an arm that is no name")
        run = run_folder(folder, PAIRS, job["label"], job["arm"], job["seed"])
        found[job["seed"]][job["label"]][job["arm"]] = run
    return found


def is_whole(pairs: dict[str, Runs]) -> bool:
    """Whether all networks of a seed are there."""
    return all((run / POLICY).is_file() for runs in pairs.values() for run in runs.values())


def of_pair(seed: int, pair: str, runs: Runs, others: Runs) -> list[Layer]:
    """Compare the networks of a pair; `others` are the runs of the seed before, if there is one.

    Raises:
        ConfigError: a run or a network cannot be read, none is from scratch, or there are several sources.
    """
    from torch import Generator

    from ship_trl.explain.cka import cka
    from ship_trl.explain.networks import untrained
    from ship_trl.explain.saliency import choose
    from ship_trl.explain.states import draw_states
    from ship_trl.policies.named import load_with_network
    from ship_trl.run.process import configure_process
    from ship_trl.sim.env import ShipEnv

    configure_process()
    results = {arm: result_of(run) for arm, run in runs.items()}
    sources = {result.source_network for result in results.values()} - {None}
    source = str(next(iter(sources), None))
    # What a policy is called may also be a program, and a stranger's result may name one.
    if SCRATCH not in runs or len(sources) != 1 or Path(source).suffix != ".safetensors":
        wanted = "allowed: a run from scratch, and arms of one source, a safetensors file"
        raise ConfigError(f"folder: pair {pair}, seed {seed}: sources {sorted(map(str, sources))}; {wanted}")
    world, colour = settings_of(runs[SCRATCH])
    case = load_case(results[SCRATCH].target, world)
    env = ShipEnv(case, world, 1, colour=colour)

    def load(name: str | Path) -> DuelingNetwork:
        return load_with_network(str(name), env)[1]

    packaged = load(PRETRAINED)
    draws = Generator().manual_seed(STATES_SEED)
    drawn = draw_states(
        case, world, env.rasteriser, lambda pixels: choose(packaged, pixels), EPISODES, draws
    ).pixels
    scratch = load(runs[SCRATCH] / POLICY)
    blank = untrained(scratch, Generator().manual_seed(seed))[0]
    own = {arm: grams(load(run / POLICY), drawn) for arm, run in runs.items()}
    known = {SOURCE: grams(load(source), drawn)}
    beside = {arm: known | {SCRATCH: own[SCRATCH]} for arm in own}
    beside[SCRATCH] = known | {UNTRAINED: grams(blank, drawn)}
    if others:
        beside[SCRATCH][OTHER_SEED] = grams(load(others[SCRATCH] / POLICY), drawn)
    return [
        Layer(seed, pair, arm, name, layer, round(cka(kernel, other[layer]), 4))
        for arm, found in own.items()
        for name, other in beside[arm].items()
        for layer, kernel in found.items()
        if layer in other
    ]


def grams(network: DuelingNetwork, pixels: Tensor) -> dict[str, Floats]:
    """Compute the inner products of states in each layer of a network: pixels [N, ...] to [N, N] by layer."""
    import torch

    from ship_trl.explain.cka import gram

    with torch.no_grad():
        return {layer: gram(given) for layer, given in network.activations(pixels).items()}


def result_of(run: Path) -> Result:
    """Read the result of a run.

    Raises:
        ConfigError: it is not whole.
    """
    try:
        return read_result(run)
    except ResultError as error:
        raise ConfigError(f"folder: {run} {error}") from None
