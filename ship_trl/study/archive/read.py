"""A study's folder from its copy (see `write`): results and curves, and what is refused."""

from __future__ import annotations

import csv
import json
import lzma
import os
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from ship_trl.config import ConfigError
from ship_trl.result import RESULT
from ship_trl.study.analysis.manifest import PLAN
from ship_trl.study.analysis.records import CURVE, BrokenRunError, read_placed
from ship_trl.study.archive.write import (
    COLUMNS,
    CURVES,
    DRAWN,
    GREEDY,
    KEPT,
    RUNS,
    TRAINED,
    Row,
    digest,
    from_cell,
    read_plan,
    write_rows,
)
from ship_trl.study.plan.jobs import PARTS


@dataclass(frozen=True)
class Copy:
    """A copy that was looked at: `runs` are parts and results in the order of the curves."""

    folder: Path
    plan: dict[str, Any]
    runs: list[tuple[str, dict[str, Any]]]


def is_copy(folder: Path) -> bool:
    """Whether a folder holds a copy, whole or not, and not a study itself."""
    return any((folder / name).is_file() for name in (RUNS, CURVES))


def read_copy(copy: Path) -> Copy:
    """Look at a copy; curves are read when it is unpacked.

    Raises:
        ConfigError: it is not one, is cut short, or names runs that a study has not.
    """
    plan = read_plan(copy / PLAN, "copy")
    for name in (RUNS, CURVES):
        try:
            same = digest(copy / name) == plan[KEPT][name]
        except (OSError, KeyError, TypeError):
            same = False
        if not same:
            raise ConfigError(f"copy: {copy / name} is not the file that {PLAN} was kept with")
    runs, places = [], set()
    try:
        with (copy / RUNS).open(newline="") as file:
            for row in csv.DictReader(file):
                result = deep({key: from_cell(cell) for key, cell in row.items() if cell})
                part = str(result.pop("part"))
                places.add(place_of(part, result))
                runs.append((part, result))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, csv.Error) as error:
        raise ConfigError(f"copy: {copy / RUNS} cannot be read: {error}") from None
    if not runs or len(places) < len(runs):
        raise ConfigError(f"copy: {copy / RUNS} has no run, or one twice")
    return Copy(copy, plan, runs)


def deep(row: dict[str, Any]) -> dict[str, Any]:
    """Make a result of its cells."""
    result: dict[str, Any] = {}
    for key, value in row.items():
        outer, _, inner = key.partition(".")
        if inner:
            result.setdefault(outer, {})[inner] = value
        else:
            result[outer] = value
    return result


def place_of(part: str, result: dict[str, Any]) -> Path:
    """Name a run's folder in its study.

    Raises:
        ValueError: a name that would lead out of it, or is none.
    """
    names, seed = (result["pair"], result["arm"]), result["seed"]
    if part not in PARTS or not all(map(is_name, names)) or type(seed) is not int or seed < 0:
        raise ValueError(
            f"no run of a study is named {part:.40} {names[0]!s:.40} {names[1]!s:.40} {seed!s:.40}"
        )
    return Path(part, *names, f"seed={seed}")


def is_name(word: Any) -> bool:
    """Whether a word may name a folder below another."""
    if not isinstance(word, str) or word in (".", ".."):
        return False
    return 0 < len(word) < 100 and word.isprintable() and "/" not in word


def unpack(copy: Copy, folder: Path, seeds: set[int] | None = None) -> int:
    """Write `study.json`, and result and curve of each run of these seeds (None: of all); returns how many.

    Raises:
        ConfigError: curves that are not whole, or do not fit the results.
    """
    path = copy.folder / CURVES
    found, epsilon = 0, dict[str, str]()
    try:
        with lzma.open(path, "rt", newline="") as file:
            groups = groupby(csv.DictReader(file), key=lambda row: row["run"])
            for number, (part, result) in enumerate(copy.runs):
                run, rows = next(groups, ("", iter(())))
                if run != str(number):
                    raise ValueError(f"run {number} has no rows")
                lines, draws = unpacked(rows, epsilon)
                if seeds is not None and result["seed"] not in seeds:
                    continue
                place = folder / place_of(part, result)
                write_run(place, result | ({"draws": draws} if draws else {}), lines)
                read_placed(place, part)
                found += 1
            if next(groups, None) is not None:
                raise ValueError("more rows than runs")
    except (lzma.LZMAError, EOFError, ValueError, KeyError, TypeError, csv.Error, BrokenRunError) as error:
        raise ConfigError(f"copy: {path} cannot be read: {error}") from None
    plan = {key: value for key, value in copy.plan.items() if key != KEPT}
    (folder / PLAN).write_text(json.dumps(plan, indent=1))
    return found


def unpacked(rows: Iterable[Row], epsilon: dict[str, str]) -> tuple[list[Row], list[float]]:
    """Make a run's rows lines of `curve.csv`, and give its draws.

    `epsilon` by episode is that of the run before, and becomes this one's where it has one.
    """
    lines, draws = [], []
    given: dict[str, str] = {}
    for row in rows:
        prefix = "greedy_" if row["kind"] == GREEDY else ""
        if row["kind"] == DRAWN:
            draws.append(float(row["return"]))
            continue
        lines.append({"episode": row["episode"]} | {prefix + key: row[key] for key in COLUMNS[4:]})
        if row["kind"] == TRAINED:
            given[row["episode"]] = row["epsilon"]
    if any(given.values()):
        epsilon.clear()
        epsilon |= given
    for line in lines:
        if "return" in line:
            line["epsilon"] = epsilon[line["episode"]]
    return lines, draws


def write_run(place: Path, result: dict[str, Any], lines: list[Row]) -> None:
    """Write `result.json` and `curve.csv`."""
    columns = ["episode", "epsilon", *COLUMNS[4:], *(f"greedy_{key}" for key in COLUMNS[4:])]
    place.mkdir(parents=True)
    with (place / CURVE).open("w", newline="") as file:
        write_rows(file, columns, lines)
    (place / RESULT).write_text(json.dumps(result, indent=1))


def restore(copy: Copy, folder: Path) -> tuple[int, list[int]]:
    """Make a study's folder of the seeds that are complete; returns how many runs, and the other seeds.

    Of a seed that is not, runs that are still to do would begin with networks that are no more: it is
    trained anew as a whole.

    Raises:
        ConfigError: something is there already, no seed is complete, or the copy cannot be unpacked.
    """
    planned = {(job["part"], job["label"], job["arm"], job["seed"]) for job in copy.plan["jobs"]}
    have = {(part, run["pair"], run["arm"], run["seed"]) for part, run in copy.runs}
    seeds = {seed for *_, seed in planned}
    complete = seeds - {seed for *_, seed in planned - have}
    if not complete:
        raise ConfigError(f"copy: {copy.folder} has no seed with all its runs; a study anew does as much")
    folder = folder.resolve()
    draft = folder.with_name(f".{folder.name}.{os.getpid()}")
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"folder: {folder} is there already; allowed: a new one")
        draft.mkdir(parents=True)
        found = unpack(copy, draft, complete)
        draft.rename(folder)
    except OSError as error:
        raise ConfigError(f"folder: {error.filename or folder} cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return found, sorted(({seed for *_, seed in have} | seeds) - complete)
