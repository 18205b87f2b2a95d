"""A study as tables: what its report needs of every whole run, without networks.

`study.json` is the plan. `runs.csv` has a row for each run, by seed: its part of the study and its result.
`curves.csv.xz` has a row for each training episode, greedy evaluation and draw before training, in the order
of the runs: `run` (row number in `runs.csv`, from 0), `kind` (training, greedy or draw), `episode`,
`epsilon`, `return` (3 decimals), `outcome`, `dcpa` (metres, 1 decimal). Each seed is compressed alone, so a
further seed only adds bytes at the end, which keeps a repository small. `pandas.read_csv` reads both.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import lzma
import math
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import is_name
from ship_trl.files.curve import GREEDY, SHARED, TRAINING, TYPES, write_curve
from ship_trl.files.disk import atomic_write, read_file, writing
from ship_trl.files.result import Result, ResultError, from_json, write_result
from ship_trl.files.table import read_table, rows
from ship_trl.files.untrusted import Bounded
from ship_trl.study.manifest import PLAN, read_plan
from ship_trl.study.plan import PARTS, Job, run_folder
from ship_trl.study.records.record import BrokenRunError, make_record, read_runs

if TYPE_CHECKING:
    import pandas as pd

    from ship_trl.study.records.record import Run

RUNS, CURVES, KEPT = "runs.csv", "curves.csv.xz", "kept"
COLUMNS = ("run", "kind", "episode", "epsilon", *SHARED)
DRAW = "draw"
# The strongest preset that takes less than 100 MB of memory.
PRESET = 6 | lzma.PRESET_EXTREME
# A source network's last path components, from its study's folder on; the ones above name a machine.
SOURCE_PATH_PARTS = 5
# Bytes of uncompressed curves: a study of a thousand runs of 5,000 episodes has 0.4 GB.
MAX_CURVE_BYTES = 4 * 10**9
# What reading a damaged table raises.
DAMAGED = (OSError, ValueError, LookupError, TypeError, OverflowError, EOFError, lzma.LZMAError)


def has_tables(folder: Path) -> bool:
    """Return whether a folder holds tables, whole or not, instead of runs."""
    return any((folder / name).is_file() for name in (RUNS, CURVES))


def read_tables(folder: Path, key: str = "folder") -> tuple[dict[str, Any], list[Run]]:
    """Read a study's plan and runs, as they would be read from the runs' folders.

    Messages name `key`, the argument that gave the folder.
    """
    plan = read_plan(folder / PLAN, key)
    kept = plan.get(KEPT)
    for path in (folder / RUNS, folder / CURVES):
        if not isinstance(kept, dict) or not path.is_file() or digest(path) != kept.get(path.name):
            raise ConfigError(f"{key}: {path} is not the file that {PLAN} was kept with")
    with refused(key, folder / RUNS):
        results = [from_cells(cells) for _, cells in rows(read_file(folder / RUNS), ("part",))]
        places = [place_of(part, result) for part, result in results]
    if not results or len(set(places)) < len(results):
        raise ConfigError(f"{key}: {folder / RUNS} has no run, or a run twice")
    runs: list[Run] = []
    with refused(key, folder / CURVES):
        curves = dict(iter(read_curves(folder / CURVES).groupby("run", sort=False)))
        if list(curves) != list(range(len(results))):
            raise ValueError(f"its runs are not those of {RUNS}")
        for (part, result), place, curve in zip(results, places, curves.values(), strict=True):
            is_draw = curve["kind"] == DRAW
            whole, curve = replace(result, draws=curve["return"][is_draw].tolist()), curve[~is_draw]
            runs.append((make_record(whole, curve, folder / place, part), curve))
    return plan, runs


@contextmanager
def refused(key: str, path: Path) -> Iterator[None]:
    """Say in one line why a table cannot be read."""
    try:
        yield
    except (*DAMAGED, ResultError, BrokenRunError) as error:
        raise ConfigError(f"{key}: {path} cannot be read: {' '.join(str(error).split())}") from None


def read_curves(path: Path) -> pd.DataFrame:
    """Read the curves of all runs; `DAMAGED` lists what a damaged table raises."""
    import pandas as pd

    types = TYPES | {"run": "int64", "kind": "category", "outcome": "category"}
    with lzma.open(path) as file:
        unpacked = io.BufferedReader(Bounded(file, MAX_CURVE_BYTES))
        curves = pd.read_csv(unpacked, usecols=list(COLUMNS), dtype=types, index_col=False)
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
    if (copy / PLAN).exists() and KEPT not in read_plan(copy / PLAN, "copy"):
        raise ConfigError(f"copy: {copy} holds a study; allowed: another folder")
    broken: list[tuple[Path, str]] = []
    runs = sorted(read_runs(folder, broken), key=lambda run: (run[0].result.seed, *run[0].place))
    if not runs and has_tables(folder):
        raise ConfigError(f"folder: {folder} holds a study's tables; allowed: a study's folder of runs")
    if not runs:
        raise ConfigError(f"folder: no finished run below {folder}; python -m ship_trl study makes some")
    plan = {key: plan[key] for key in ("settings", "cases", "judged", "rules", "jobs") if key in plan}
    names = [one.name for one in fields(Job) if one.name != "values"]
    plan["jobs"] = [{name: job[name] for name in names} for job in plan["jobs"]]
    table = pd.DataFrame([{"part": record.part} | to_cells(record.result) for record, _ in runs])
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
            plan[KEPT] = {RUNS: digest(runs_draft), CURVES: digest(curves_draft)}
            with writing(copy / PLAN, plan_draft):
                plan_draft.write_text(json.dumps(plan) + "\n")
    except OSError as error:
        raise ConfigError(f"copy: {error.filename or copy} cannot be written: {error.strerror}") from None
    return len(runs), len(broken)


def write_curves(path: Path, runs: Sequence[Run]) -> None:
    """Write draws and curves of runs, which are sorted by seed."""
    import pandas as pd

    with path.open("wb") as file:
        for _, runs_of_seed in groupby(enumerate(runs), lambda numbered: numbered[1][0].result.seed):
            parts = []
            for number, (record, curve) in runs_of_seed:
                draws = pd.DataFrame({"kind": DRAW, "episode": 0, "return": record.result.draws})
                parts.append((pd.concat([draws, curve]) if len(draws) else curve).assign(run=number))
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
    planned = {(job["part"], job["label"], job["arm"], job["seed"]) for job in plan["jobs"]}
    have = {(*record.place, record.result.seed) for record, _ in runs}
    seeds = {seed for *_, seed in planned}
    complete = seeds - {seed for *_, seed in planned - have}
    restored = [run for run in runs if run[0].result.seed in complete]
    if not complete:
        raise ConfigError(f"copy: {copy} has no seed with all its runs; start a new study instead")
    folder = folder.resolve()
    draft = folder.with_name(f".{folder.name}.{os.getpid()}")
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"folder: {folder} is there already; allowed: a new one")
        draft.mkdir(parents=True)
        for record, rows in restored:
            place = draft / place_of(record.part, record.result)
            place.mkdir(parents=True)
            write_curve(place, rows)
            write_result(place, record.result)
        del plan[KEPT]
        (draft / PLAN).write_text(json.dumps(plan, indent=1))
        draft.rename(folder)
    except OSError as error:
        raise ConfigError(f"folder: {error.filename or folder} cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return len(restored), sorted(({seed for *_, seed in have} | seeds) - complete)


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(read_file(path)).hexdigest()


def to_cells(result: Result) -> dict[str, str]:
    """Write a result as cells, without its draws; the cell "best.return" is the return of "best"."""
    values = result.to_json()
    del values["draws"]
    if result.source_network is not None:
        values["source_network"] = "/".join(Path(result.source_network).parts[-SOURCE_PATH_PARTS:])
    row: dict[str, str] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            row |= {f"{key}.{name}": as_cell(inner) for name, inner in value.items()}
        else:
            row[key] = as_cell(value)
    return row


def from_cells(row: dict[str, str]) -> tuple[str, Result]:
    """Read part and result of a run from its cells."""
    values: dict[str, Any] = {}
    for key, cell in row.items():
        outer, _, inner = key.partition(".")
        if cell and inner:
            values.setdefault(outer, {})[inner] = from_cell(cell)
        elif cell:
            values[outer] = from_cell(cell)
    return str(values.pop("part")), from_json(values | {"draws": []})


def as_cell(value: Any) -> str:
    """Write a value as JSON, or as plain text if that cannot be mistaken for JSON."""
    return value if isinstance(value, str) and from_cell(value) == value and value else json.dumps(value)


def from_cell(cell: str) -> Any:
    """Read a cell as JSON, or else as text."""
    try:
        return json.loads(cell)
    except (ValueError, RecursionError):
        return cell


def place_of(part: str, result: Result) -> Path:
    """Return a run's folder below its study's folder; raise ValueError if its names could lead elsewhere."""
    if part not in PARTS or not (is_name(result.pair) and is_name(result.arm)) or result.seed < 0:
        found = f"{part:.40} {result.pair:.40} {result.arm:.40} {result.seed}"
        raise ValueError(f"no run of a study is named {found}")
    return run_folder(Path(), part, result.pair, result.arm, result.seed)


LAYERS = "layers.csv"
# The table of 15 seeds has 0.2 MB.
MAX_BYTES = 20_000_000
# What an arm is compared with: its source, and scratch of its seed. Scratch is compared with the source, with
# scratch of the seed before, and with random weights.
SOURCE, SCRATCH, OTHER_SEED, UNTRAINED = "source", "scratch", "other seed", "untrained"


class Layer(NamedTuple):
    """The CKA of a layer in an arm's network and in the network `beside` it."""

    seed: int
    pair: str
    arm: str
    beside: str
    layer: str
    cka: float


def read_layers(path: Path) -> list[Layer]:
    """Read a table of layers, or raise a ConfigError."""
    return read_table(path, Layer._fields, layer_of, MAX_BYTES, "table", "a table of layers")


def layer_of(row: dict[str, str]) -> Layer:
    """Read a row from its cells; raise ValueError for a wrong one."""
    words = {name: row[name] for name in ("pair", "arm", "beside", "layer")}
    if not all(map(is_name, words.values())):
        raise ValueError("a row without a name")
    cka = float(row["cka"])
    # The estimate is unbiased, so it may be a little above 1 or below 0. NaN is allowed.
    if math.isinf(cka) or abs(cka) > 2:
        raise ValueError(f"a CKA of {cka:g}")
    return Layer(int(row["seed"]), **words, cka=cka)


def write_layers(path: Path, rows: Sequence[Layer]) -> None:
    """Write a table of layers, by seed."""
    ordered = sorted(rows, key=lambda row: row.seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as draft, draft.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Layer._fields)
        writer.writerows(ordered)
