"""Find the finished runs in a folder and below. No torch."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ship_trl.config.errors import one_line, print_error
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.run.plan import DAMAGED


@dataclass(frozen=True)
class Found:
    """A finished run: its result, its folder, the folder that was searched, and its part of the study.

    Several parts of a study may have the same pair and arm.
    """

    result: Result
    folder: Path
    below: Path
    part: str

    @property
    def place(self) -> str:
        """The pair, with the part of the study in front if there is one."""
        return f"{self.part}/{self.result.pair}" if self.part else self.result.pair


def collect(folder: Path) -> tuple[list[Found], list[tuple[Path, str]]]:
    """Return the results in `folder` and below, and the path and the error of each unreadable one."""
    found, broken = [], []
    for path in sorted(folder.rglob(RESULT)):
        if path.parent.name.startswith(DAMAGED):
            continue
        try:
            part = one_line("/".join(path.relative_to(folder).parts[:-4]))
            found.append(Found(read_result(path.parent), path.parent, folder, part))
        except ResultError as error:
            broken.append((path, str(error)))
    return found, broken


def drop_copies(found: Iterable[Found]) -> list[Found]:
    """Drop copies of another run, which are not further seeds, and print a warning for each."""
    kept: dict[tuple[str, str], Found] = {}
    for one in found:
        known = kept.setdefault((one.place, repr(one.result)), one)
        if known is not one:
            print_error(f"{one.folder} is a copy of {known.folder}; left out")
    return list(kept.values())


def group_runs(found: Iterable[Found]) -> dict[str, list[Found]]:
    """Group runs by folder, part, profile, pair and arm; return each group by its name, sorted by seed."""
    groups: dict[tuple[str, ...], list[Found]] = {}
    for one in found:
        names = (str(one.below), one.part, one.result.profile, one.result.pair, one.result.arm)
        groups.setdefault(names, []).append(one)
    several = len({below for below, *_ in groups}) > 1
    rows: dict[str, list[Found]] = {}
    for (below, *_, arm), runs in sorted(groups.items()):
        name = f"{runs[0].place} {arm}"
        row = rows.setdefault(f"{below}: {name}" if several else name, [])
        row += sorted(runs, key=lambda one: one.result.seed)
    return rows


def folders_of(found: Iterable[Found]) -> dict[str, list[Path]]:
    """Return the folders of each group."""
    return {name: [one.folder for one in runs] for name, runs in group_runs(found).items()}
