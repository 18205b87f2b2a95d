"""A study as tables: what its report needs of every whole run, without networks.

`study.json` is the plan. `runs.csv` has a row for each run, by seed: its part of the study and its result.
`curves.csv.xz` has a row for each training episode, greedy evaluation and draw before training, in the order
of the runs: `run` (row number in `runs.csv`, from 0), `kind` (training, greedy or draw), `episode`,
`epsilon`, `return` (3 decimals), `outcome`, `dcpa` (metres, 1 decimal). Each seed is compressed alone, so a
further seed only adds bytes at the end, which keeps a repository small. `pandas.read_csv` reads both.
"""

from __future__ import annotations

import hashlib
import io
import lzma
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.paths import is_name
from ship_trl.files.curve import GREEDY, SHARED, TRAINING, TYPES, RunError, write_curve
from ship_trl.files.disk import MAX_FILE_BYTES, atomic_write, read_file, writing
from ship_trl.files.record import RESULT, RunRecord, check_run, from_cells, read_whole, with_curve
from ship_trl.files.untrusted import read_table, rows
from ship_trl.study.manifest import PLAN, Plan, read_plan
from ship_trl.study.plan import PARTS

if TYPE_CHECKING:
    import pandas as pd

RUNS, CURVES = "runs.csv", "curves.csv.xz"
COLUMNS = ("run", "kind", "episode", "epsilon", *SHARED)
DRAW = "draw"
# The strongest preset that takes less than 100 MB of memory.
PRESET = 6 | lzma.PRESET_EXTREME
# What reading a damaged table raises.
DAMAGED = (OSError, ValueError, LookupError, TypeError, OverflowError, EOFError, lzma.LZMAError)


def has_tables(folder: Path) -> bool:
    """Return whether a folder holds tables, whole or not, instead of runs."""
    return any((folder / name).is_file() for name in (RUNS, CURVES))


def read_tables(folder: Path, key: str = "folder") -> tuple[Plan, list[RunRecord]]:
    """Read a study's plan and runs, as they would be read from the runs' folders.

    Messages name `key`, the argument that gave the folder.
    """
    plan = read_plan(folder / PLAN, key)
    for path in (folder / RUNS, folder / CURVES):
        if not path.is_file() or digest(path) != plan.kept.get(path.name):
            raise ConfigError(f"{key}: {path} is not the file that {PLAN} was kept with")
    with refused(key, folder / RUNS):
        kept_runs = [from_cells(cells) for _, cells in rows(read_file(folder / RUNS), ("part",))]
        places = [place_of(run) for run in kept_runs]
    if not kept_runs or len(set(places)) < len(kept_runs):
        raise ConfigError(f"{key}: {folder / RUNS} has no run, or a run twice")
    runs: list[RunRecord] = []
    with refused(key, folder / CURVES):
        curves = dict(iter(read_curves(folder / CURVES).groupby("run", sort=False)))
        if list(curves) != list(range(len(kept_runs))):
            raise ValueError(f"its runs are not those of {RUNS}")
        for run, place, curve in zip(kept_runs, places, curves.values(), strict=True):
            is_draw = curve["kind"] == DRAW
            draws = curve["return"][is_draw].tolist()
            runs.append(check_run(replace(run, draws=draws, rows=curve[~is_draw], folder=folder / place)))
    return plan, runs


@contextmanager
def refused(key: str, path: Path) -> Iterator[None]:
    """Say in one line why a table cannot be read."""
    try:
        yield
    except (*DAMAGED, RunError) as error:
        raise ConfigError(f"{key}: {path} cannot be read: {' '.join(str(error).split())}") from None


def read_curves(path: Path) -> pd.DataFrame:
    """Read the curves of all runs; `DAMAGED` lists what a damaged table raises."""
    import pandas as pd

    types = TYPES | {"run": "int64", "kind": "category", "outcome": "category"}
    with lzma.open(path) as file:
        # A small file may hold very many bytes.
        unpacked = file.read(MAX_FILE_BYTES + 1)
    if len(unpacked) > MAX_FILE_BYTES:
        raise ValueError(f"unpacked it has more than {MAX_FILE_BYTES} bytes")
    curves = pd.read_csv(io.BytesIO(unpacked), usecols=list(COLUMNS), dtype=types, index_col=False)
    if not curves["kind"].isin((TRAINING, GREEDY, DRAW)).all():
        raise ValueError(f"kind: must be {TRAINING}, {GREEDY} or {DRAW}")
    return curves


def write_tables(folder: Path, copy: Path) -> tuple[int, int]:
    """Write a study's whole runs as tables; the same runs give the same bytes.

    Returns:
        The number of runs, and the number of runs left out because they are not whole.
    """
    import pandas as pd

    plan = read_plan(folder / PLAN, "folder")
    if (copy / PLAN).exists() and not read_plan(copy / PLAN, "copy").kept:
        raise ConfigError(f"copy: {copy} holds a study; allowed: another folder")
    broken: list[tuple[Path, str]] = []
    runs = sorted(read_runs(folder, broken), key=lambda run: (run.seed, *run.place))
    if not runs and has_tables(folder):
        raise ConfigError(f"folder: {folder} holds a study's tables; allowed: a study's folder of runs")
    if not runs:
        raise ConfigError(f"folder: no finished run below {folder}; python -m ship_trl study run makes some")
    table = pd.DataFrame([run.to_cells() for run in runs])
    try:
        copy.mkdir(parents=True, exist_ok=True)
        # Compression takes a minute. All files are written before one is renamed, and the plan is renamed
        # last: without the digests in it the tables are no copy.
        with (
            atomic_write(copy / PLAN) as plan_draft,
            atomic_write(copy / CURVES) as curves_draft,
            atomic_write(copy / RUNS) as runs_draft,
        ):
            table.to_csv(runs_draft, index=False, lineterminator="\n")
            with writing(copy / CURVES, curves_draft):
                write_curves(curves_draft, runs)
            kept = {RUNS: digest(runs_draft), CURVES: digest(curves_draft)}
            jobs = [replace(job, values={}) for job in plan.jobs]
            with writing(copy / PLAN, plan_draft):
                plan_draft.write_text(replace(plan, jobs=jobs, kept=kept).to_json() + "\n")
    except OSError as error:
        raise ConfigError(f"copy: {error.filename or copy} cannot be written: {error.strerror}") from None
    return len(runs), len(broken)


def write_curves(path: Path, runs: Sequence[RunRecord]) -> None:
    """Write draws and curves of runs, which are sorted by seed."""
    import pandas as pd

    with path.open("wb") as file:
        for _, runs_of_seed in groupby(enumerate(runs), lambda numbered: numbered[1].seed):
            parts = []
            for number, run in runs_of_seed:
                draws = pd.DataFrame({"kind": DRAW, "episode": 0, "return": run.draws})
                parts.append((pd.concat([draws, run.curve]) if len(draws) else run.curve).assign(run=number))
            form = {"columns": COLUMNS, "index": False, "lineterminator": "\n"}
            text = pd.concat(parts).to_csv(None, header=not file.tell(), **form)
            file.write(lzma.compress(text.encode(), preset=PRESET))


def restore(copy: Path, folder: Path) -> tuple[int, list[int]]:
    """Write a study's folder with the complete seeds of its tables.

    Other seeds are trained again as a whole: their missing runs would need networks that no longer exist.

    Returns:
        The number of restored runs, and the seeds that are not complete.
    """
    plan, runs = read_tables(copy, "copy")
    planned = {(job.part, job.label, job.arm, job.seed) for job in plan.jobs}
    have = {(*run.place, run.seed) for run in runs}
    seeds = {seed for *_, seed in planned}
    complete = seeds - {seed for *_, seed in planned - have}
    restored = [run for run in runs if run.seed in complete]
    if not complete:
        raise ConfigError(f"copy: {copy} has no seed with all its runs; start a new study instead")
    folder = folder.resolve()
    draft = folder.with_name(f".{folder.name}.{os.getpid()}")
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"folder: {folder} is there already; allowed: a new one")
        draft.mkdir(parents=True)
        for run in restored:
            place = draft / place_of(run)
            place.mkdir(parents=True)
            write_curve(place, run.curve)
            run.write(place)
        (draft / PLAN).write_text(replace(plan, kept={}).to_json(indent=1))
        draft.rename(folder)
    except OSError as error:
        raise ConfigError(f"folder: {error.filename or folder} cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return len(restored), sorted(({seed for *_, seed in have} | seeds) - complete)


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(read_file(path)).hexdigest()


def place_of(run: RunRecord) -> Path:
    """Return a run's folder below its study's folder; raise ValueError if its names could lead elsewhere."""
    if run.part not in PARTS or not (is_name(run.pair) and is_name(run.arm)) or run.seed < 0:
        found = f"{run.part:.40} {run.pair:.40} {run.arm:.40} {run.seed}"
        raise ValueError(f"no run of a study is named {found}")
    return Path(run.part, run.pair, run.arm, f"seed={run.seed}")


LAYERS = "layers.csv"
# The table of 15 seeds has 0.2 MB.
MAX_BYTES = 20_000_000
# What an arm is compared with: its source, and scratch of its seed. Scratch is compared with the source, with
# scratch of the seed before, and with random weights.
SOURCE, SCRATCH, OTHER_SEED, UNTRAINED = "source", "scratch", "other seed", "untrained"


# A row is the CKA of a layer in an arm's network and in the network `beside` it.
LAYER_NAMES = ("pair", "arm", "beside", "layer")
LAYER_TYPES = {"seed": "int64", **dict.fromkeys(LAYER_NAMES, "str"), "cka": "float64"}


def read_layers(path: Path) -> pd.DataFrame:
    """Read a table of layers, with the columns of `LAYER_TYPES`, or raise a ConfigError."""
    import pandas as pd

    try:
        rows = read_table(path, tuple(LAYER_TYPES), dict, MAX_BYTES, "table", "a table of layers")
        table = pd.DataFrame(rows, columns=list(LAYER_TYPES)).astype(LAYER_TYPES)
        if not table[[*LAYER_NAMES]].map(is_name).all(axis=None):
            raise ValueError("a row without a name")
        # The estimate is unbiased, so it may be a little above 1 or below 0. NaN is allowed.
        if (table["cka"].abs() > 2).any():
            raise ValueError("a CKA beyond 2")
    except (ValueError, OverflowError) as error:
        raise ConfigError(f"table: {path} is not a table of layers: {error}") from None
    return table


def write_layers(path: Path, table: pd.DataFrame) -> None:
    """Write a table of layers, by seed."""
    with atomic_write(path) as draft:
        ordered = table.sort_values("seed", kind="stable")
        ordered.to_csv(draft, index=False, na_rep="nan", lineterminator="\n")


# Fields of a result, beside the settings, that may change digits.
COMPUTED = ("ship_trl", "torch", "device", "precision", "backend", "processor")
# End of the message for runs outside a study's parts.
NO_PART = "is no part of a study"


def read_groups(groups: Mapping[str, Sequence[RunRecord]]) -> Iterator[tuple[str, RunRecord]]:
    """Yield the runs of each group with their curves and its name; name those not whole on stderr."""
    for name, runs in groups.items():
        for run in runs:
            try:
                if run.best_known_return is None:
                    raise RunError(f"{RESULT}: has no best known return, as its starts are drawn")
                yield name, with_curve(run)
            except RunError as error:
                print_error(f"{run.folder}: {error}; left out")


def read_placed(folder: Path, part: str = "") -> RunRecord:
    """Read a run's folder, whose path must name the run: a copied folder is no further seed."""
    run = read_whole(folder, part)
    if folder.parts[-3:] != (*run.place[1:], f"seed={run.seed}"):
        raise RunError(f"{RESULT} is of another run")
    return run


def read_runs(folder: Path, broken: list[tuple[Path, str]]) -> Iterator[RunRecord]:
    """Yield the whole runs below a study's folder; add the others to `broken`, with the reason."""
    for path in sorted(folder.glob("**/seed=*")):
        inside = path.relative_to(folder).parts
        if not path.is_dir() or inside[0] == "case_base":
            continue
        part = "/".join(inside[:-3])
        try:
            if part not in PARTS:
                raise RunError(f"{part or folder} {NO_PART}")
            yield read_placed(path, part)
        except RunError as error:
            broken.append((path, str(error)))
