"""A study as tables: all that its report needs of every whole run, and no network.

`study.json` is the plan. `runs.csv` has a row for each run, by seed: its part of the study and its result.
`curves.csv.xz` has a row for each training episode, greedy evaluation and draw before training, in the order
of the runs: `run` (row number in `runs.csv`, from 0), `kind` (training, greedy or draw), `episode`,
`epsilon`, `return` (3 decimals), `outcome`, `dcpa` (metres, 1 decimal). Each seed is compressed alone: a
further seed adds bytes at the end, which keeps a repository small. `pandas.read_csv` reads both.
"""

from __future__ import annotations

import hashlib
import io
import json
import lzma
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import is_name
from ship_trl.files.curve import GREEDY, SHARED, TRAINING, TYPES
from ship_trl.files.disk import atomic_write, read_file, writing
from ship_trl.files.result import Result, ResultError, from_json
from ship_trl.files.table import rows
from ship_trl.files.untrusted import Bounded
from ship_trl.study.plan.jobs import PARTS, PlannedJob, run_folder
from ship_trl.study.plan.manifest import PLAN, read_plan
from ship_trl.study.records.record import BrokenRunError, Record, make_record, read_runs

if TYPE_CHECKING:
    import pandas as pd

RUNS, CURVES, KEPT = "runs.csv", "curves.csv.xz", "kept"
COLUMNS = ("run", "kind", "episode", "epsilon", *SHARED)
DRAW = "draw"
# The strongest preset that takes less than 100 MB of memory.
PRESET = 6 | lzma.PRESET_EXTREME
# A source network's last path components, from its study's folder on; the ones above name a machine.
SOURCE_PATH_PARTS = 5
# Bytes of uncompressed curves: a study of a thousand runs of 5,000 episodes has 0.4 GB.
MAX_CURVE_BYTES = 4 * 10**9


@dataclass(frozen=True)
class Tables:
    """A study's tables: its plan, part and result of each run, and all curves.

    `key` is the argument that named the folder, for messages.
    """

    folder: Path
    plan: dict[str, Any]
    runs: list[tuple[str, Result]]
    curves: pd.DataFrame
    key: str = "folder"

    def by_run(self) -> Iterator[tuple[Record, Result, pd.DataFrame]]:
        """Yield the record, result and curve of each run, as they would be read from its folder.

        Raises:
            ConfigError: curves that are not whole, or that belong to other runs.
        """
        groups = dict(iter(self.curves.groupby("run", sort=False)))
        if list(groups) != list(range(len(self.runs))):
            raise unreadable(self.key, self.folder / CURVES, "its runs are not those of " + RUNS)
        for number, (part, bare) in enumerate(self.runs):
            group = groups[number]
            is_draw = group["kind"] == DRAW
            result, curve = replace(bare, draws=group["return"][is_draw].tolist()), group[~is_draw]
            try:
                record = make_record(result, curve, self.folder / place_of(part, result), part)
            except BrokenRunError as error:
                raise unreadable(self.key, self.folder / CURVES, error) from None
            yield record, result, curve


def has_tables(folder: Path) -> bool:
    """Return whether a folder holds tables, whole or not, instead of runs."""
    return any((folder / name).is_file() for name in (RUNS, CURVES))


def read_tables(folder: Path, key: str = "folder") -> Tables:
    """Read a study's tables.

    Args:
        folder: of the tables.
        key: the argument that named the folder, for messages.

    Raises:
        ConfigError: a table is missing, damaged, or holds no run of a study.
    """
    plan = read_plan(folder / PLAN, key)
    for name in (RUNS, CURVES):
        try:
            same = digest(folder / name) == plan[KEPT][name]
        except (OSError, KeyError, TypeError):
            same = False
        if not same:
            raise ConfigError(f"{key}: {folder / name} is not the file that {PLAN} was kept with")
    try:
        runs = read_results(folder / RUNS)
        places = {place_of(part, result) for part, result in runs}
    except (OSError, ValueError, KeyError, TypeError, ResultError) as error:
        raise unreadable(key, folder / RUNS, error) from None
    if not runs or len(places) < len(runs):
        raise ConfigError(f"{key}: {folder / RUNS} has no run, or one twice")
    try:
        curves = read_curves(folder / CURVES)
    except (lzma.LZMAError, EOFError, OSError, ValueError, OverflowError) as error:
        raise unreadable(key, folder / CURVES, error) from None
    return Tables(folder, plan, runs, curves, key)


def read_results(path: Path) -> list[tuple[str, Result]]:
    """Read part and result of each run.

    Raises:
        OSError, ValueError, KeyError, TypeError, ResultError: the table is damaged.
    """
    return [from_cells(cells) for cells in rows(read_file(path), ("part",))]


def read_curves(path: Path) -> pd.DataFrame:
    """Read the curves of all runs.

    Raises:
        lzma.LZMAError, EOFError, OSError, ValueError, OverflowError: the table is damaged.
    """
    import pandas as pd

    types = TYPES | {"run": "int64", "kind": "category", "outcome": "category"}
    with lzma.open(path) as file:
        unpacked = io.BufferedReader(Bounded(file, MAX_CURVE_BYTES))
        curves = pd.read_csv(unpacked, usecols=list(COLUMNS), dtype=types, index_col=False)
    if not curves["kind"].isin((TRAINING, GREEDY, DRAW)).all():
        raise ValueError(f"kind: must be {TRAINING}, {GREEDY} or {DRAW}")
    return curves


def unreadable(key: str, path: Path, error: object) -> ConfigError:
    """Return an error that says in one line why a table cannot be read."""
    return ConfigError(f"{key}: {path} cannot be read: {' '.join(str(error).split())}")


def write_tables(folder: Path, copy: Path) -> tuple[int, int]:
    """Write a study's whole runs as tables; the same runs give the same bytes.

    Returns:
        The number of runs, and the number of runs left out because they are not whole.

    Raises:
        ConfigError: the folder holds no study or no whole run, or the tables cannot be written.
    """
    import pandas as pd

    plan = read_plan(folder / PLAN, "folder")
    if (copy / PLAN).exists() and KEPT not in read_plan(copy / PLAN, "copy"):
        raise ConfigError(f"copy: {copy} holds a study; allowed: another folder")
    broken: list[tuple[Path, str]] = []
    whole = sorted(
        read_runs(folder, broken), key=lambda run: (run[0].seed, run[0].part, run[0].pair, run[0].arm.name)
    )
    if not whole and has_tables(folder):
        raise ConfigError(f"folder: {folder} holds a study's tables; allowed: a study's folder of runs")
    if not whole:
        raise ConfigError(f"folder: no finished run below {folder}; python -m ship_trl study makes some")
    plan = {key: plan[key] for key in ("settings", "cases", "judged", "rules", "jobs") if key in plan}
    names = [one.name for one in fields(PlannedJob)]
    plan["jobs"] = [{name: job[name] for name in names} for job in plan["jobs"]]
    try:
        copy.mkdir(parents=True, exist_ok=True)
        runs = pd.DataFrame([{"part": record.part} | to_cells(result) for record, result, _ in whole])
        # Compression takes a minute. All files are written before one is renamed, and the plan is renamed
        # last: without the digests in it the tables are no copy.
        with (
            atomic_write(copy / PLAN) as plan_draft,
            atomic_write(copy / CURVES) as curves_draft,
            atomic_write(copy / RUNS) as runs_draft,
        ):
            runs.to_csv(runs_draft, index=False, lineterminator="\n")
            with writing(copy / CURVES, curves_draft), curves_draft.open("wb") as file:
                for _, runs_of_seed in groupby(enumerate(whole), lambda run: run[1][0].seed):
                    curves = pd.concat([with_draws(number, *run[1:]) for number, run in runs_of_seed])
                    text = curves.to_csv(
                        None, columns=COLUMNS, index=False, header=not file.tell(), lineterminator="\n"
                    )
                    file.write(lzma.compress(text.encode(), preset=PRESET))
            plan[KEPT] = {RUNS: digest(runs_draft), CURVES: digest(curves_draft)}
            with writing(copy / PLAN, plan_draft):
                plan_draft.write_text(json.dumps(plan) + "\n")
    except OSError as error:
        raise ConfigError(f"copy: {error.filename or copy} cannot be written: {error.strerror}") from None
    return len(whole), len(broken)


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
        inner = {f"{key}.{name}": v for name, v in value.items()} if isinstance(value, dict) else {key: value}
        row |= {name: as_cell(v) for name, v in inner.items()}
    return row


def from_cells(row: dict[str, str]) -> tuple[str, Result]:
    """Read part and result of a run from its cells.

    Raises:
        ResultError, ValueError, KeyError, TypeError: the cells are of no run.
    """
    values: dict[str, Any] = {}
    for key, cell in row.items():
        outer, _, inner = key.partition(".")
        if cell and inner:
            values.setdefault(outer, {})[inner] = from_cell(cell)
        elif cell:
            values[outer] = from_cell(cell)
    return str(values.pop("part")), from_json(values)


def as_cell(value: Any) -> str:
    """Write a value as JSON, or as plain text if that cannot be mistaken for JSON."""
    return value if isinstance(value, str) and from_cell(value) == value and value else json.dumps(value)


def from_cell(cell: str) -> Any:
    """Read a cell as JSON, or else as text."""
    try:
        return json.loads(cell)
    except (ValueError, RecursionError):
        return cell


def with_draws(number: int, result: Result, curve: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a run: its draws, then its curve."""
    import pandas as pd

    drawn = pd.DataFrame({"kind": DRAW, "episode": 0, "return": result.draws})
    return (pd.concat([drawn, curve]) if result.draws else curve).assign(run=number)


def place_of(part: str, result: Result) -> Path:
    """Return a run's folder below its study's folder.

    Raises:
        ValueError: a name that would lead out of the study, or that no run has.
    """
    if part not in PARTS or not (is_name(result.pair) and is_name(result.arm)) or result.seed < 0:
        found = f"{part:.40} {result.pair:.40} {result.arm:.40} {result.seed}"
        raise ValueError(f"no run of a study is named {found}")
    return run_folder(Path(), part, result.pair, result.arm, result.seed)
