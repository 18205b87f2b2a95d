"""Describe one trial, and compare what two folders hold after it."""

import json
import random
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Files that differ between equal runs: logs, locks, and the grid that a study asked Hydra for.
IGNORED_FILES = {"log.txt", ".locks", "multirun.yaml"}
# Keys of JSON files that hold a time, and a time within text.
TIME_KEYS = {"seconds", "begun"}
TIME = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+Z:0-9]*")
# A draft: a file that is written beside another one, and then renamed over it.
DRAFT = re.compile(r"(^|/)\.(?!locks/|plans/)[^/]*(/[^/]*)?$")


@dataclass(frozen=True)
class Trial:
    """What was done, what went wrong (empty if nothing), and how many faults were made."""

    what: str
    problem: str = ""
    faults: int = 1


# Yields trials without end; takes a random generator and an empty folder.
Kind = Callable[[random.Random, Path], Iterator[Trial]]


def conclude(folder: Path, what: str, problems: list[str], faults: int = 1) -> Trial:
    """Return the trial that was made in a folder, which is kept only if there are problems."""
    if not problems:
        shutil.rmtree(folder)
    return Trial(f"{folder}: {what}", "; ".join(problems), faults)


def contents(folder: Path) -> dict[str, bytes]:
    """Read all files below a folder, drafts too, without times and the folder's own name."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if IGNORED_FILES & set(name.parts) or not path.is_file() or path.is_symlink():
            continue
        data = path.read_bytes().replace(str(folder.resolve()).encode(), b"FOLDER")
        found[str(name)] = drop_times(data) if path.suffix == ".json" else TIME.sub(b"TIME", data)
    return found


def drop_times(data: bytes) -> bytes:
    """Remove the keys of times from a JSON file; return other files as they are."""

    def dropped(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: dropped(inner) for key, inner in value.items() if key not in TIME_KEYS}
        return value

    try:
        return json.dumps(dropped(json.loads(data))).encode()
    except ValueError:
        return data


def drop_drafts(found: dict[str, bytes]) -> dict[str, bytes]:
    """Leave out drafts outside the folders of runs: a kill may leave one, and nothing reads it."""
    in_run = re.compile(r"(^|/)seed=\d+/")
    return {name: data for name, data in found.items() if not DRAFT.search(name) or in_run.search(name)}


def difference(wanted: dict[str, bytes], found: dict[str, bytes]) -> str:
    """Name up to four differences between two folders; return an empty text if there are none."""
    differences = [f"{name} is missing" for name in wanted.keys() - found.keys()]
    differences += [f"{name} is left behind" for name in found.keys() - wanted.keys()]
    differences += [f"{name} differs" for name in wanted.keys() & found.keys() if wanted[name] != found[name]]
    return "; ".join(sorted(differences)[:4])
