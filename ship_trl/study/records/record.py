"""Read the runs of a study: folders whose paths name what they hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from ship_trl.config.errors import print_error
from ship_trl.files.curve import RunError
from ship_trl.files.record import RESULT, RunRecord, read_whole, with_curve
from ship_trl.study.plan import PARTS

# Fields of a result, beside the settings, that may change digits.
COMPUTED = ("ship_trl", "torch", "device", "precision", "backend", "processor")
# End of the message for runs outside a study's parts.
NO_PART = "is no part of a study"


def read_groups(groups: Mapping[str, Sequence[RunRecord]]) -> Iterator[tuple[str, RunRecord]]:
    """Yield the runs of each group with their curves and its name; name those not whole on stderr."""
    for name, runs in groups.items():
        for run in runs:
            try:
                yield name, with_curve(run)
            except RunError as error:
                print_error(f"{run.folder}: {error}; left out")


def read_placed(folder: Path, part: str = "") -> RunRecord:
    """Read a run's folder, whose path must name the run: a copied folder is no further seed."""
    run = read_whole(folder, part)
    if folder.parts[-3:] != (*run.place[1:], f"seed={run.seed}"):
        raise RunError(f"{RESULT} is of another run")
    return run


def read_runs(folder: Path, broken: list[tuple[Path, str]]) -> Iterator[RunRecord]:
    """Yield the whole runs below a study's folder; add the others to `broken`, with the reason."""
    for path in sorted(folder.glob("**/seed=*")):
        inside = path.relative_to(folder).parts
        if not path.is_dir() or inside[0] == "case_base":
            continue
        part = "/".join(inside[:-3])
        try:
            if part not in PARTS:
                raise RunError(f"{part or folder} {NO_PART}")
            yield read_placed(path, part)
        except RunError as error:
            broken.append((path, str(error)))
