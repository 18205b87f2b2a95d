"""The folder of the YAML files, and valid names of files and folders."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

# Characters of a name from a file, such as a case's or a result's.
MAX_NAME_LENGTH = 100
# Bytes of a path from the command line, and of each name in it: a run adds a little to them.
MAX_PATH_BYTES, MAX_PATH_NAME_BYTES = 3000, 200
PACKAGE = Path(__file__).resolve().parents[1]
# YAML files of one's own, in the working directory.
OWN_CONF = Path("conf")


def is_name(word: str) -> bool:
    """Return whether a word may name a file or folder inside another, and be printed."""
    is_short = len(word) < MAX_NAME_LENGTH
    return word not in ("", ".", "..") and is_short and word.isprintable() and "/" not in word


def stem(path: str | Path) -> str:
    """Return a file's name without its suffix; from Python 3.14 on pathlib finds none in `...yaml`."""
    name, _, suffix = Path(path).name.rpartition(".")
    return name if name and suffix else Path(path).name


def is_path(text: str) -> bool:
    """Return whether a file system accepts a text as a path, with a little added to it."""
    try:
        names = [os.fsencode(name) for name in Path(text).parts]
    except UnicodeEncodeError:
        return False
    # An empty path, for example of an unset shell variable, would be the working directory.
    is_short = bool(text) and sum(map(len, names)) + len(names) <= MAX_PATH_BYTES
    return is_short and all(len(name) <= MAX_PATH_NAME_BYTES and b"\0" not in name for name in names)


def conf_dir() -> Path:
    """Return the folder of the YAML files: the checkout's, else the one inside the installed package.

    The checkout's comes first, because an editable install can leave a stale copy in the package.
    """
    for folder in (PACKAGE.parent / "conf", PACKAGE / "conf"):
        if (folder / "config.yaml").is_file():
            return folder
    raise FileNotFoundError(f"no conf/config.yaml beside or inside {PACKAGE}")


def conf_files(group: str) -> dict[str, Path]:
    """Return the files of a config group by name: the working directory's conf/, else the bundled."""
    folders = conf_dir() / group, OWN_CONF / group
    return {stem(path): path for folder in folders for path in sorted(folder.glob("*.yaml"))}


def group_names(group: str) -> str:
    """List the names of a config group, for people."""
    return list_names(conf_files(group))


def module_names(folder: str) -> list[str]:
    """List the modules of a folder of the package, sorted; those with a leading underscore are left out."""
    return sorted(stem(path) for path in (PACKAGE / folder).glob("[!_]*.py"))


def list_names(names: Iterable[str]) -> str:
    """List names, sorted, for people; the Imazu problems are a range, without their variants."""
    first = "imazu01"
    listed = sorted(name for name in names if name == first or not re.match(r"imazu\d", name))
    return ", ".join("imazu01 to imazu22" if name == first else name for name in listed)
