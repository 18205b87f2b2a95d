"""The real command of a study, at smoke size."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

from tests.command import SMOKE, files, ship_trl

SMALL = (
    *("profile=smoke", "pairs=[high]", "arms=[scratch,FTW]", "reuse=false", "controls=false", "retries=1"),
    f"overrides=[{','.join(SMOKE[1:])}]",
)


def study(
    *overrides: str, folder: Path, code: int = 0, pictures: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run `python -m ship_trl study run ...` in `folder`, and check its exit code."""
    return ship_trl(*overrides, folder=folder, verb="study run", code=code, pictures=pictures)


def own_study(folder: Path) -> None:
    """Write a case, a pair and a study of one's own into a folder."""
    case = (
        "start: [0, 0]\ncourse: 0\ngoal: [0, 600]\nideal_path: starboard-29m\n"
        "target_ships: [{x: 0, y: 900, course: 180, speed: 10}]\n"
    )
    pair = "# @package _global_\npair: harbour\nsource: '3'\ntarget: mine\n"
    study = 'question: "Help: from case 3?"\nprofile: smoke\npairs: [harbour]\narms: [scratch, FT3]\n'
    for name, text in {"conf/case/mine": case, "conf/pair/harbour": pair, "harbour": study}.items():
        path = folder / f"{name}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def learned(folder: Path) -> dict[str, bytes]:
    """What was learned: curves and weights of all runs."""
    found = files(folder / "outputs/smoke_study")
    return {name: data for name, data in found.items() if name.endswith(("curve.csv", ".safetensors"))}


def descendants(ancestor: int, begins: bytes = b"") -> list[int]:
    """Living processes that come from another and whose command line begins so."""
    parents, found = {}, []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            # Behind the name, which may hold anything: state and parent.
            state, parent = place.joinpath("stat").read_text().rpartition(")")[2].split()[:2]
            parents[int(place.name)] = int(parent)
            if state != "Z" and place.joinpath("cmdline").read_bytes().startswith(begins):
                found.append(int(place.name))
        except OSError:
            continue
    return [process for process in found if ancestor in ancestors(process, parents)]


def ancestors(process: int, parents: dict[int, int]) -> Iterator[int]:
    while process in parents:
        process = parents[process]
        yield process
