"""CKA by layer between the networks of a study (`python -m ship_trl study layers FOLDER TABLE`).

The kept tables of a study hold no networks, so this is measured while the runs exist. All arms of a seed are
compared on the same states of the target case. The report draws a layers.csv beside the study's tables.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

from ship_trl.config.errors import ConfigError, counted
from ship_trl.config.paths import is_name
from ship_trl.files.curve import RunError
from ship_trl.files.record import read_run
from ship_trl.policies.pretrained import PRETRAINED
from ship_trl.run.plan import read_settings
from ship_trl.run.results import locate
from ship_trl.sim.cases import load_case
from ship_trl.study.manifest import PLAN, load_plan
from ship_trl.study.plan import PAIRS
from ship_trl.study.tables import (
    LAYER_TYPES,
    OTHER_SEED,
    SCRATCH,
    SOURCE,
    UNTRAINED,
    read_layers,
    write_layers,
)
from ship_trl.transfer.casebase import POLICY

if TYPE_CHECKING:
    from ship_trl.explain.states import Floats
    from ship_trl.learn.network import DuelingNetwork

# Half of the episodes take random actions, half those of the bundled network of the case; where none is
# bundled, those of the seed's network from scratch.
EPISODES, STATES_SEED = 60, 0
Layer = tuple[int, str, str, str, str, float]
# Folders of runs, by arm.
Runs = dict[str, Path]


def add_seeds(folder: Path, path: Path) -> None:
    """Measure the seeds with all their networks that the table (a CSV) lacks; write the table after each.

    Raises:
        ConfigError: the folder holds no study or no complete seed, or the table cannot be read.
    """
    import pandas as pd

    table = read_layers(path) if path.exists() else pd.DataFrame(columns=list(LAYER_TYPES))
    done = set(table["seed"])
    # By seed, pair and arm.
    planned: dict[int, dict[str, Runs]] = defaultdict(lambda: defaultdict(dict))
    for job in load_plan(folder).jobs:
        if job.part == PAIRS:
            if not (is_name(job.label) and is_name(job.arm)):
                raise ConfigError(f"folder: {folder / PLAN} has a pair or an arm whose name is not allowed")
            planned[job.seed][job.label][job.arm] = job.folder(folder)
    complete = {
        seed: pairs
        for seed, pairs in sorted(planned.items())
        if all((run / POLICY).is_file() for runs in pairs.values() for run in runs.values())
    }
    for seed in sorted(complete.keys() - done):
        started, found = time.monotonic(), []
        for pair, runs in complete[seed].items():
            earlier = [s for s, others in complete.items() if s < seed and SCRATCH in others.get(pair, {})]
            other_seed = complete[earlier[-1]][pair][SCRATCH] if earlier else None
            found += compare_pair(seed, pair, runs, other_seed)
        new = pd.DataFrame(found, columns=list(LAYER_TYPES))
        table = pd.concat([table, new]) if done else new
        done.add(seed)
        write_layers(path, table)
        sys.stdout.write(f"seed {seed}: {len(found)} numbers, {time.monotonic() - started:.0f} s\n")
        sys.stdout.flush()
    if not done:
        raise ConfigError(f"folder: {folder} has no seed with the networks of all arms of the pairs")
    sys.stdout.write(f"{counted(len(done), 'seed')}; {path}\n")


def compare_pair(seed: int, pair: str, runs: Runs, other_seed: Path | None) -> list[Layer]:
    """Compare the networks of a pair: rows of `LAYER_TYPES`.

    `other_seed` is the run from scratch of an earlier seed.

    Raises:
        ConfigError: a run or a network cannot be read, none is from scratch, or there are several sources.
    """
    import torch
    from torch import Generator

    from ship_trl.explain.encoding import cka, gram
    from ship_trl.explain.networks import make_untrained
    from ship_trl.explain.states import draw_states
    from ship_trl.fast.worlds import make_env
    from ship_trl.policies.named import load_with_network
    from ship_trl.run.process import configure_process

    configure_process()
    results = {}
    for arm, run in runs.items():
        try:
            results[arm] = read_run(run)
        except RunError as error:
            raise ConfigError(f"folder: {run}: {error}") from None
    sources = {result.source_network for result in results.values()} - {None}
    source = str(next(iter(sources), None))
    # A policy may also be a program, and an untrusted result may name one.
    if SCRATCH not in runs or len(sources) != 1 or Path(source).suffix != ".safetensors":
        wanted = "allowed: a run from scratch, and arms of one source, a safetensors file"
        raise ConfigError(f"folder: pair {pair}, seed {seed}: sources {sorted(map(str, sources))}; {wanted}")
    world, colour, *_ = read_settings(runs[SCRATCH])
    env = make_env(load_case(results[SCRATCH].target, world), world, 1, colour=colour)

    def load(name: str | Path) -> DuelingNetwork:
        return load_with_network(str(name), env)[1]

    of_scratch = load(runs[SCRATCH] / POLICY)
    if of_scratch.config.linear:
        raise ConfigError(f"folder: pair {pair}: its networks see numbers; allowed: networks that see pixels")
    try:
        bundled = load(PRETRAINED)
    except ConfigError:
        bundled = of_scratch
    player = of_scratch if bundled.config.linear else bundled
    states = draw_states(env, player, EPISODES, Generator().manual_seed(STATES_SEED)).states

    def kernels(network: DuelingNetwork) -> dict[str, Floats]:
        with torch.no_grad():
            found = network.activations(env.observer(network.config, network.colour)(states))
        return {layer: gram(values) for layer, values in found.items()}

    of_arm = {arm: kernels(load(run / POLICY)) for arm, run in runs.items()}
    untrained = make_untrained(of_scratch, Generator().manual_seed(seed))
    shared = {SOURCE: kernels(load(locate(source, runs[SCRATCH])))}
    others = {arm: shared | {SCRATCH: of_arm[SCRATCH]} for arm in of_arm}
    others[SCRATCH] = shared | {UNTRAINED: kernels(untrained)}
    if other_seed:
        others[SCRATCH][OTHER_SEED] = kernels(load(other_seed / POLICY))
    return [
        (seed, pair, arm, name, layer, round(cka(kernel, other[layer]), 4))
        for arm, found in of_arm.items()
        for name, other in others[arm].items()
        for layer, kernel in found.items()
        if layer in other
    ]
