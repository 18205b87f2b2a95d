"""Where the YAML files lie, and which words may name a file or folder."""

from __future__ import annotations

from pathlib import Path

# What results are named by may name a folder too.
LONGEST_NAME = 100


def is_name(word: str) -> bool:
    """Whether a word may name a file or folder below another, and be printed."""
    return word not in ("", ".", "..") and len(word) < LONGEST_NAME and word.isprintable() and "/" not in word


def conf_dir() -> Path:
    """Find the folder of the YAML files: the checkout's, else the one inside the installed package.

    The checkout's wins, because an editable install can leave a stale copy in the package.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package.parent / "conf", package / "conf"):
        if (folder / "config.yaml").is_file():
            return folder
    raise FileNotFoundError(f"no conf/config.yaml beside or inside {package}")


def group_names(group: str) -> str:
    """List the names of a config group, for people."""
    return ", ".join(sorted(path.stem for path in (conf_dir() / group).glob("*.yaml")))
