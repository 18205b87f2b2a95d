"""A study as tables: what its report needs of every whole run, and no network.

`study.json` is what was planned. `runs.csv` has a row for each run, by seed: its part of the study and its
result. `curves.csv.xz` has one for each training episode, greedy evaluation and draw before training, in the
order of the runs: `run` (the number of its row in `runs.csv`, from 0), `kind` (training, greedy or draw),
`episode`, `epsilon`, `return` (3 decimals), `outcome`, `dcpa` (metres, 1 decimal). Each seed is packed alone:
a study that goes on by a seed adds bytes at the end, which costs a repository little. `pandas.read_csv` reads
both.
"""

from __future__ import annotations

import hashlib
import io
import json
import lzma
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import is_name
from ship_trl.files.curve import GREEDY, SHARED, TRAINING, TYPES
from ship_trl.files.disk import read_file, replacing, writing
from ship_trl.files.result import Result, ResultError, from_json
from ship_trl.files.untrusted import Bounded
from ship_trl.study.plan.jobs import PARTS
from ship_trl.study.plan.manifest import JOB, PLAN, read_plan
from ship_trl.study.records.record import BrokenRunError, Record, make_record, read_runs

if TYPE_CHECKING:
    import pandas as pd

RUNS, CURVES, KEPT = "runs.csv", "curves.csv.xz", "kept"
COLUMNS = ("run", "kind", "episode", "epsilon", *SHARED)
DRAW = "draw"
# The strongest that takes less than 100 MB of memory.
PRESET = 6 | lzma.PRESET_EXTREME
# No table has a first line of more bytes; of one with many columns pandas would take minutes.
LONGEST = 10_000
# Where a source network lies in its study's folder, case base or not; what is above is a machine's.
INSIDE = 5
# Of the curves unpacked, at most: a study of a thousand runs of 5,000 episodes has 0.4 GB.
MOST_BYTES = 4 * 10**9


@dataclass(frozen=True)
class Tables:
    """A study's plan, part and result of each run, and the curves of all."""

    folder: Path
    plan: dict[str, Any]
    runs: list[tuple[str, Result]]
    curves: pd.DataFrame
    # The argument of a command that the folder was given as.
    key: str = "folder"

    def by_run(self) -> Iterator[tuple[Record, Result, pd.DataFrame]]:
        """Yield each run as a record, with its result and its curve, as they would be read from its folder.

        Raises:
            ConfigError: curves that are not whole, or not those of these runs.
        """
        groups = dict(iter(self.curves.groupby("run", sort=False)))
        if list(groups) != list(range(len(self.runs))):
            raise unreadable(self.key, self.folder / CURVES, "its runs are not those of " + RUNS)
        for number, (part, bare) in enumerate(self.runs):
            rows = groups[number]
            drawn = rows["kind"] == DRAW
            result, curve = replace(bare, draws=rows["return"][drawn].tolist()), rows[~drawn]
            try:
                record = make_record(result, curve, self.folder / place_of(part, result), part)
            except BrokenRunError as error:
                raise unreadable(self.key, self.folder / CURVES, error) from None
            yield record, result, curve


def has_tables(folder: Path) -> bool:
    """Whether a folder holds tables, whole or not, and not the runs themselves."""
    return any((folder / name).is_file() for name in (RUNS, CURVES))


def read_tables(folder: Path, key: str = "folder") -> Tables:
    """Read a study's tables; `key` names the argument that a complaint is of.

    Raises:
        ConfigError: they are none, are cut short, or name runs that a study has not.
    """
    import pandas as pd

    plan = read_plan(folder / PLAN, key)
    for name in (RUNS, CURVES):
        try:
            same = digest(folder / name) == plan[KEPT][name]
        except (OSError, KeyError, TypeError):
            same = False
        if not same:
            raise ConfigError(f"{key}: {folder / name} is not the file that {PLAN} was kept with")
    runs, places = [], set()
    try:
        data = read_file(folder / RUNS)
        if len(data.partition(b"\n")[0]) > LONGEST:
            raise ValueError("its first line is too long")
        rows = pd.read_csv(io.BytesIO(data), dtype=str, keep_default_na=False)
        for row in rows.to_dict("records"):
            part, result = run_of({str(key): cell for key, cell in row.items()})
            places.add(place_of(part, result))
            runs.append((part, result))
    except (OSError, ValueError, KeyError, TypeError, ResultError) as error:
        raise unreadable(key, folder / RUNS, error) from None
    if not runs or len(places) < len(runs):
        raise ConfigError(f"{key}: {folder / RUNS} has no run, or one twice")
    try:
        types = TYPES | {"run": "int64", "kind": "category", "outcome": "category"}
        with lzma.open(folder / CURVES) as file:
            unpacked = io.BufferedReader(Bounded(file, MOST_BYTES))
            curves = pd.read_csv(unpacked, usecols=list(COLUMNS), dtype=types, index_col=False)
        if not curves["kind"].isin((TRAINING, GREEDY, DRAW)).all():
            raise ValueError(f"kind: must be {TRAINING}, {GREEDY} or {DRAW}")
    except (lzma.LZMAError, EOFError, OSError, ValueError, OverflowError) as error:
        raise unreadable(key, folder / CURVES, error) from None
    return Tables(folder, plan, runs, curves, key)


def unreadable(key: str, path: Path, error: object) -> ConfigError:
    """Say in one line why a table cannot be read."""
    return ConfigError(f"{key}: {path} cannot be read: {' '.join(str(error).split())}")


def write_tables(folder: Path, copy: Path) -> tuple[int, int]:
    """Write a study's whole runs as tables; the same runs give the same bytes.

    Returns:
        How many runs, and how many are not whole.

    Raises:
        ConfigError: the folder holds no study or no whole run, or the tables cannot be written there.
    """
    import pandas as pd

    plan = read_plan(folder / PLAN, "folder")
    if (copy / PLAN).exists() and KEPT not in read_plan(copy / PLAN, "copy"):
        raise ConfigError(f"copy: {copy} holds a study; allowed: another folder")
    broken: list[tuple[Path, str]] = []
    whole = sorted(read_runs(folder, broken), key=lambda run: place(run[0]))
    if not whole and has_tables(folder):
        raise ConfigError(f"folder: {folder} holds a study's tables; allowed: a study's folder of runs")
    if not whole:
        raise ConfigError(f"folder: no finished run below {folder}; python -m ship_trl study makes some")
    plan = {key: plan[key] for key in ("settings", "cases", "judged", "rules", "jobs") if key in plan}
    plan["jobs"] = [{key: job[key] for key in JOB} for job in plan["jobs"]]
    try:
        copy.mkdir(parents=True, exist_ok=True)
        runs = pd.DataFrame([{"part": record.part} | cells(result) for record, result, _ in whole])
        # All are written before one is renamed, the plan last: without it, or with that of another time, the
        # others are no copy, and packing takes a minute.
        with (
            replacing(copy / PLAN) as planned,
            replacing(copy / CURVES) as packed,
            replacing(copy / RUNS) as listed,
        ):
            runs.to_csv(listed, index=False, lineterminator="\n")
            with writing(copy / CURVES, packed), packed.open("wb") as file:
                for _, runs_of_seed in groupby(enumerate(whole), lambda run: run[1][0].seed):
                    curves = pd.concat([with_draws(number, *run[1:]) for number, run in runs_of_seed])
                    text = curves.to_csv(
                        None, columns=COLUMNS, index=False, header=not file.tell(), lineterminator="\n"
                    )
                    file.write(lzma.compress(text.encode(), preset=PRESET))
            plan[KEPT] = {RUNS: digest(listed), CURVES: digest(packed)}
            with writing(copy / PLAN, planned):
                planned.write_text(json.dumps(plan) + "\n")
    except OSError as error:
        raise ConfigError(f"copy: {error.filename or copy} cannot be written: {error.strerror}") from None
    return len(whole), len(broken)


def place(record: Record) -> tuple[int, str, str, str]:
    """Order a study's runs: by seed, then by part, pair and arm."""
    return record.seed, record.part, record.pair, record.arm


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(read_file(path)).hexdigest()


def cells(result: Result) -> dict[str, str]:
    """Write a result as cells, without the draws; "best.return" is the return of "best"."""
    values = result.to_json()
    del values["draws"]
    if result.source_network is not None:
        values["source_network"] = "/".join(Path(result.source_network).parts[-INSIDE:])
    row: dict[str, str] = {}
    for key, value in values.items():
        inner = {f"{key}.{name}": v for name, v in value.items()} if isinstance(value, dict) else {key: value}
        row |= {name: as_cell(v) for name, v in inner.items()}
    return row


def run_of(row: dict[str, str]) -> tuple[str, Result]:
    """Make part and result of a run of its cells.

    Raises:
        ResultError, ValueError, KeyError, TypeError: they are of no run.
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
    """JSON, but for words that cannot be taken for it; an empty cell is no value at all."""
    return value if isinstance(value, str) and from_cell(value) == value and value else json.dumps(value)


def from_cell(cell: str) -> Any:
    """Read what a cell stands for."""
    try:
        return json.loads(cell)
    except (ValueError, RecursionError):
        return cell


def with_draws(number: int, result: Result, curve: pd.DataFrame) -> pd.DataFrame:
    """Make the rows of a run: its draws, then its curve."""
    import pandas as pd

    drawn = pd.DataFrame({"kind": DRAW, "episode": 0, "return": result.draws})
    return (pd.concat([drawn, curve]) if result.draws else curve).assign(run=number)


def place_of(part: str, result: Result) -> Path:
    """Name a run's folder in its study.

    Raises:
        ValueError: a name that would lead out of it, or is none.
    """
    if part not in PARTS or not (is_name(result.pair) and is_name(result.arm)) or result.seed < 0:
        found = f"{part:.40} {result.pair:.40} {result.arm:.40} {result.seed}"
        raise ValueError(f"no run of a study is named {found}")
    return Path(part, result.pair, result.arm, f"seed={result.seed}")
