"""`python -m ship_trl.explain.study FOLDER TABLE`: how alike the layers of a study's networks are.

It looks at the best networks of the pairs' runs while they are there, for the tables that are kept of a study
hold none. TABLE is a CSV, to which the seeds are added that it lacks. A number is the CKA (`explain/cka.py`)
of a layer of two networks, over states of the target case that are the same for every seed and arm.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ship_trl.cli import make_parser, refusals
from ship_trl.config import ConfigError
from ship_trl.entries import settings_of
from ship_trl.paths import replacing
from ship_trl.pretrained import PRETRAINED
from ship_trl.result import Result, ResultError, read_result
from ship_trl.sim.cases import load_case
from ship_trl.study.plan.jobs import PAIRS
from ship_trl.study.plan.manifest import PLAN, read_plan
from ship_trl.transfer.casebase import POLICY

if TYPE_CHECKING:
    import pandas as pd

# Ten states are taken of each episode; half of them are sailed at random, half by the packaged network.
EPISODES, STATES_SEED = 60, 0
SCRATCH = "scratch"


class Layer(NamedTuple):
    """A row: CKA of a layer of an arm's network and of the one that it stands `beside`.

    An arm stands beside the source that it began with, and beside the network from scratch of its seed. That
    one stands beside the source too, which is of another case, beside the packaged network of its own case,
    which is of another seed, and beside one of drawn weights.
    """

    seed: int
    pair: str
    arm: str
    beside: str
    layer: str
    cka: float


def main(arguments: list[str] | None = None) -> None:
    """Read the command line, and add the seeds that the table lacks."""
    parser = make_parser("ship_trl.explain.study", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a study's, with its networks")
    parser.add_argument("table", type=Path, metavar="TABLE", help="a CSV; the seeds that it has are kept")
    options = parser.parse_args(arguments)
    with refusals():
        write_layers(options.folder, options.table)


def read_layers(path: Path) -> pd.DataFrame:
    """Read a table of layers.

    Raises:
        ConfigError: it is none.
    """
    import pandas as pd

    types = Layer.__annotations__
    try:
        table = pd.read_csv(path, usecols=list(Layer._fields), index_col=False)
        table = table.astype({"seed": "int64", "cka": "float64"})
    except (OSError, ValueError, OverflowError) as error:
        raise ConfigError(f"table: {path} cannot be read: {' '.join(str(error).split())}") from None
    return table[list(types)]


def write_layers(folder: Path, path: Path) -> None:
    """Measure the seeds that the table lacks and whose networks are all there, and write it anew.

    Raises:
        ConfigError: the folder holds no study, or no seed is whole, or the table is none.
    """
    import pandas as pd

    known = read_layers(path) if path.exists() else pd.DataFrame(columns=list(Layer._fields))
    places: dict[int, set[tuple[str, str]]] = {}
    for job in read_plan(folder / PLAN, "folder")["jobs"]:
        if job["part"] == PAIRS:
            places.setdefault(job["seed"], set()).add((job["label"], job["arm"]))
    rows: list[Layer] = []
    done = set(known["seed"])
    for seed in sorted(places.keys() - done):
        begun = time.monotonic()
        runs = {place: folder.joinpath(PAIRS, *place, f"seed={seed}") for place in sorted(places[seed])}
        if all((run / POLICY).is_file() for run in runs.values()):
            rows += of_seed(seed, runs)
            done.add(seed)
            sys.stdout.write(f"seed {seed}: {len(runs)} networks, {time.monotonic() - begun:.0f} s\n")
            sys.stdout.flush()
    if not done:
        raise ConfigError(f"folder: {folder} has no seed with the networks of all arms of the pairs")
    table = pd.concat([known, pd.DataFrame(rows, columns=list(Layer._fields))]) if rows else known
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as draft:
        table.sort_values("seed", kind="stable").to_csv(draft, index=False, lineterminator="\n")
    sys.stdout.write(f"{len(done)} seeds; {path}\n")


def of_seed(seed: int, runs: dict[tuple[str, str], Path]) -> list[Layer]:
    """Compare the networks of a seed; `runs` are their folders by pair and arm."""
    from ship_trl.run.process import configure_process

    configure_process()
    return [
        row
        for pair in sorted({pair for pair, _ in runs})
        for row in of_pair(seed, pair, {arm: run for (of, arm), run in runs.items() if of == pair})
    ]


def of_pair(seed: int, pair: str, runs: dict[str, Path]) -> list[Layer]:
    """Compare the networks of a pair; `runs` are their folders by arm.

    Raises:
        ConfigError: a run or its source's network cannot be read, or none is from scratch.
    """
    from torch import Generator

    from ship_trl.explain.cka import cka, gram
    from ship_trl.explain.networks import untrained
    from ship_trl.explain.saliency import choose
    from ship_trl.explain.states import draw_states
    from ship_trl.policies import load_with_network
    from ship_trl.sim.env import ShipEnv

    results = {arm: result_of(run) for arm, run in runs.items()}
    if SCRATCH not in runs:
        raise ConfigError(f"folder: pair {pair} has no run from scratch of seed {seed}")
    world, colour = settings_of(runs[SCRATCH])
    case = load_case(results[SCRATCH].target, world)
    env = ShipEnv(case, world, 1, colour=colour)

    def load(name: str) -> Any:
        return load_with_network(name, env)[1]

    packaged = load(PRETRAINED)
    generator = Generator().manual_seed(STATES_SEED)
    pixels = draw_states(
        case, world, env.rasteriser, lambda seen: choose(packaged, seen), EPISODES, generator
    ).pixels

    def kernels(network: Any) -> dict[str, Any]:
        import torch

        with torch.no_grad():
            return {layer: gram(given) for layer, given in network.activations(pixels).items()}

    own = {arm: kernels(load(str(run / POLICY))) for arm, run in runs.items()}
    drawn = untrained(packaged, Generator().manual_seed(seed))[0]
    beside = {"other seed": kernels(packaged), "untrained": kernels(drawn)}
    sources = {name for result in results.values() if (name := result.source_network) is not None}
    if len(sources) != 1:
        raise ConfigError(
            f"folder: arms of pair {pair}, seed {seed}, have {len(sources)} sources; allowed: one"
        )
    source = kernels(load(sources.pop()))
    compared = [
        (arm, name, found, other)
        for arm, found in own.items()
        for name, other in (
            {"source": source} | (beside if arm == SCRATCH else {SCRATCH: own[SCRATCH]})
        ).items()
    ]
    return [
        Layer(seed, pair, arm, name, layer, round(cka(found[layer], other[layer]), 4))
        for arm, name, found, other in compared
        for layer in found
    ]


def result_of(run: Path) -> Result:
    """Read the result of a run.

    Raises:
        ConfigError: it is not whole.
    """
    try:
        return read_result(run)
    except ResultError as error:
        raise ConfigError(f"folder: {run} {error}") from None


if __name__ == "__main__":
    main()
