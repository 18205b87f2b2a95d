"""A study in three small files: what its report needs of every whole run, and no network.

`study.json` is what was planned, `runs.csv` has a row for each run, and `curves.csv.xz` one for each
training episode, greedy evaluation and draw before training, in the order of the runs. Returns are
rounded to 3 decimals, distances to 1 (m).
"""

from __future__ import annotations

import csv
import hashlib
import json
import lzma
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from ship_trl.config import ConfigError
from ship_trl.paths import replacing
from ship_trl.result import read_result
from ship_trl.study.analysis.manifest import PLAN
from ship_trl.study.analysis.records import CURVE, BrokenRunError, find_runs, read_placed
from ship_trl.study.plan.jobs import PARTS

RUNS, CURVES, KEPT = "runs.csv", "curves.csv.xz", "kept"
COLUMNS = ("run", "episode", "kind", "epsilon", "outcome", "return", "dcpa")
TRAINED, GREEDY, DRAWN = "", "greedy", "draw"
# The strongest that takes less than 100 MB of memory.
PRESET = 6 | lzma.PRESET_EXTREME
# Where a source network lies in its study's folder, case base or not; what is above is a machine's.
INSIDE = 5
JOB = ("name", "stage", "part", "label", "arm", "seed")

Row = dict[str, str]


def write_copy(folder: Path, copy: Path) -> tuple[int, int]:
    """Copy a study's whole runs; the same runs give the same bytes. Returns how many, and how many are not.

    Raises:
        ConfigError: the folder holds no study or no whole run, or the copy cannot be written there.
    """
    plan = read_plan(folder / PLAN, "folder")
    if (copy / PLAN).exists() and KEPT not in read_plan(copy / PLAN, "copy"):
        raise ConfigError(f"copy: {copy} holds a study; allowed: another folder")
    whole, broken = [], 0
    for path, part in find_runs(folder):
        try:
            if part not in PARTS:
                raise BrokenRunError("no part of a study")
            record = read_placed(path, part)
        except BrokenRunError:
            broken += 1
            continue
        whole.append((part, record.pair, record.arm, record.seed, path))
    if not whole:
        raise ConfigError(f"folder: no finished run below {folder}; python -m ship_trl.study makes some")
    paths = [(path, part) for part, *_, path in sorted(whole)]
    plan = {key: plan[key] for key in ("settings", "cases", "judged", "rules", "jobs") if key in plan}
    plan["jobs"] = [{key: job[key] for key in JOB} for job in plan["jobs"]]
    try:
        copy.mkdir(parents=True, exist_ok=True)
        with replacing(copy / CURVES) as draft, lzma.open(draft, "wt", preset=PRESET, newline="") as file:
            write_rows(file, COLUMNS, curve_rows(path for path, _ in paths))
        with replacing(copy / RUNS) as draft, draft.open("w", newline="") as file:
            rows = [{"part": part} | flat(path) for path, part in paths]
            write_rows(file, list(dict.fromkeys(key for row in rows for key in row)), rows)
        # The last: without it, or with that of another time, the others are no copy.
        plan[KEPT] = {name: digest(copy / name) for name in (RUNS, CURVES)}
        with replacing(copy / PLAN) as draft:
            draft.write_text(json.dumps(plan) + "\n")
    except OSError as error:
        raise ConfigError(f"copy: {error.filename or copy} cannot be written: {error.strerror}") from None
    return len(paths), broken


def read_plan(path: Path, key: str) -> dict[str, Any]:
    """Read a `study.json`.

    Raises:
        ConfigError: there is none, or it is another program's; `key` names what it is of.
    """
    try:
        plan = json.loads(path.read_text())
        jobs = [[job[name] for name in JOB] for job in plan["jobs"]]
        if not isinstance(plan["settings"], dict) or not isinstance(plan["cases"], dict):
            raise TypeError
        if not all(list(map(type, job)) == [str, int, str, str, str, int] for job in jobs):
            raise TypeError
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise ConfigError(f"{key}: {path} is not a study's plan") from None
    return dict(plan)


def write_rows(file: Any, columns: Iterable[str], rows: Iterable[Row]) -> None:
    """Write CSV."""
    writer = csv.DictWriter(file, list(columns), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def flat(path: Path) -> Row:
    """Write a run's result as cells, without the draws; "best.return" is the return of "best"."""
    result = read_result(path).to_json()
    del result["draws"]
    if result["source_network"] is not None:
        result["source_network"] = "/".join(Path(result["source_network"]).parts[-INSIDE:])
    row: Row = {}
    for key, value in result.items():
        inner = {f"{key}.{name}": v for name, v in value.items()} if isinstance(value, dict) else {key: value}
        row |= {name: as_cell(v) for name, v in inner.items()}
    return row


def as_cell(value: Any) -> str:
    """JSON, but for words that cannot be taken for it; an empty cell is no value at all."""
    return value if isinstance(value, str) and from_cell(value) == value and value else json.dumps(value)


def from_cell(cell: str) -> Any:
    """Read what a cell stands for."""
    try:
        return json.loads(cell)
    except (ValueError, RecursionError):
        return cell


def curve_rows(paths: Iterable[Path]) -> Iterator[Row]:
    """Yield the rows of all runs; epsilon is left out where it is, by episode, that of the run before."""
    before: list[str] = []
    for number, path in enumerate(paths):
        for draw in read_result(path).draws:
            yield {"run": str(number), "kind": DRAWN, "return": rounded(draw, 3)}
        with (path / CURVE).open(newline="") as file:
            lines = list(csv.DictReader(file))
        epsilon = [line["epsilon"] for line in lines]
        for line in lines:
            kind, prefix = (TRAINED, "") if line["return"] else (GREEDY, "greedy_")
            yield {
                "run": str(number),
                "episode": line["episode"],
                "kind": kind,
                "epsilon": "" if epsilon == before else line["epsilon"],
                "outcome": line[f"{prefix}outcome"],
                "return": rounded(line[f"{prefix}return"], 3),
                "dcpa": rounded(line[f"{prefix}dcpa"], 1),
            }
        before = epsilon


def rounded(number: str | float, digits: int) -> str:
    """Write a number with so many decimals; nothing where there is none."""
    return "" if number in ("", None) else str(round(float(number), digits))
