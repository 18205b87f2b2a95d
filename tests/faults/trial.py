"""What one trial is, and what a folder holds after it."""

import json
import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Files that differ from run to run and decide nothing: what was said, what locks are held by, and what the
# last grid of a study was asked for.
PASSING = {"log.txt", ".locks", "multirun.yaml"}
# Keys of JSON files that say when or how long.
TIMES = {"seconds", "begun"}
# As a report has it in a sentence.
MOMENT = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+Z:0-9]*")

# A file that is written beside another, to be renamed over it.
DRAFT = re.compile(r"(^|/)\.(?!locks/|plans/)[^/]*(/[^/]*)?$")


@dataclass(frozen=True)
class Trial:
    """What was done, how many faults that were, and what was lost, if anything was."""

    what: str
    lost: str = ""
    faults: int = 1


# Makes trials without end, from a generator of random numbers, in a folder of its own.
Kind = Callable[[random.Random, Path], Iterator[Trial]]


def state(folder: Path) -> dict[str, bytes]:
    """Give every file below a folder by its name, without what says when; drafts are among them."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if PASSING & set(name.parts) or not path.is_file() or path.is_symlink():
            continue
        # Jobs of a study and its report name the folder that they lie in.
        data = path.read_bytes().replace(str(folder.resolve()).encode(), b"FOLDER")
        found[str(name)] = timeless(data) if path.suffix == ".json" else MOMENT.sub(b"TIME", data)
    return found


def timeless(data: bytes) -> bytes:
    """Take the times out of a JSON file; what is no JSON stays."""

    def without(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: without(one) for key, one in value.items() if key not in TIMES}
        return value

    try:
        return json.dumps(without(json.loads(data))).encode()
    except ValueError:
        return data


def difference(wanted: dict[str, bytes], got: dict[str, bytes]) -> str:
    """Say in a line how one state differs from another; nothing where they are alike."""
    words = [f"{name} is missing" for name in wanted.keys() - got.keys()]
    words += [f"{name} is too much" for name in got.keys() - wanted.keys()]
    words += [f"{name} differs" for name in wanted.keys() & got.keys() if wanted[name] != got[name]]
    return "; ".join(sorted(words)[:4])
