"""A disk that is full, and one that cannot be written.

A command runs on a file system of its own, which holds what the command needs and so many bytes more: from
none to as many as the command writes. Or it cannot be written at all: mounted so, or owned by somebody else.

Survived: the command ends with exit code 0, or with code 1 and nothing on stderr but lines that begin with
`ship_trl: `; nothing that was there before is lost, and no draft is left behind. With room again, or the
right to write, the same command ends with exit code 0, and leaves the bytes that it leaves without a fault.
"""

import itertools
import os
import random
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from tests.faults.command import Done, run
from tests.faults.files import RUN, library, marks
from tests.faults.mounted import ROOM, apart, mount
from tests.faults.runs import ALONE, STUDY, TRANSFER
from tests.faults.trial import DRAFT, Trial, difference, state

NOBODY = 65534
# Commands that write, by name: module, arguments, and how often in a hundred.
WRITERS: dict[str, tuple[str, tuple[str, ...], int]] = {
    "run": ("ship_trl", (*ALONE, "output=new"), 25),
    "transfer": ("ship_trl", (*TRANSFER, "output=new"), 25),
    "report": ("ship_trl.report", ("study",), 12),
    "keep": ("ship_trl.cli.keep", ("study", "copy"), 8),
    "restore": ("ship_trl.cli.keep", ("--restore", "tables", "again"), 5),
    "record": ("ship_trl.record", (RUN, "--output", "film.gif", "--trajectories", "chart.png"), 5),
    "demonstrations": ("ship_trl.evaluate", (RUN, "--demonstrations", "more", "--gif", "film.gif"), 5),
    "results": ("ship_trl.results", ("outputs", "--picture", "curves.png", "--csv", "numbers.csv"), 5),
    "cases": ("ship_trl.cases", ("--target", "met"), 4),
    "export": ("ship_trl.export", (RUN, "model.onnx"), 3),
    "study": ("ship_trl.study", STUDY, 3),
}


@cache
def whole(name: str) -> tuple[dict[str, bytes], int]:
    """Run a writer without a fault; returns what is there then, and how many bytes it has written."""
    folder = Path(mkdtemp(prefix="faults-")) / "whole"
    shutil.copytree(library(), folder)
    before = size_of(folder)
    module, arguments, _ = WRITERS[name]
    done = run(*arguments, folder=folder, module=module)
    assert done.code == 0, done
    return state(folder), size_of(folder) - before


def size_of(folder: Path) -> int:
    """Bytes of all blocks below a folder."""
    return sum(path.lstat().st_blocks * 512 for path in folder.rglob("*"))


def problems(done: Done, before: dict[str, tuple[int, int, int]], folder: Path) -> list[str]:
    """Say what is wrong with how a command ended on such a disk."""
    words, after = [], marks(folder)
    if "Traceback" in done.err or (done.code != 0 and not done.explained):
        words.append(f"not explained: {done}")
    changed = [path for path, mark in before.items() if after.get(path) != mark and "locks/" not in path]
    words += [f"{path} is lost" for path in changed]
    return words + [f"{path} is left behind" for path in after.keys() - before.keys() if DRAFT.search(path)]


def again(name: str, folder: Path, before: Done) -> list[str]:
    """Run a writer that has failed with nothing in its way; says what is wrong with what is left."""
    module, arguments, _ = WRITERS[name]
    done = run(*arguments, folder=folder, module=module) if before.code != 0 else before
    if done.code != 0:
        return [f"it does not come through: {done}"]
    # Demonstrations are numbered on: those that were kept before the disk was full stay.
    wanted, got = (
        {name: data for name, data in one.items() if not name.startswith("more/")}
        for one in (whole(name)[0], state(folder))
    )
    differs = difference(wanted, got)
    return [f"then {differs}"] if differs else []


def choose(rng: random.Random) -> str:
    """Choose a writer."""
    return rng.choices(list(WRITERS), [often for *_, often in WRITERS.values()])[0]


def of_full_disks(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Let a writer's disk run out."""
    for number in itertools.count():
        name = choose(rng)
        written = whole(name)[1]
        # Now and then within the last file or the first.
        room = rng.choice((rng.randrange(written), rng.randrange(8192), written - rng.randrange(8192)))
        yield full(name, max(0, room), place / str(number))


def full(name: str, room: int, folder: Path) -> Trial:
    """Run a writer where so many bytes are left."""
    folder.mkdir(parents=True)
    module, arguments, _ = WRITERS[name]
    whole(name)

    def work() -> str:
        mount(folder)
        shutil.copytree(library(), folder, dirs_exist_ok=True)
        about = os.statvfs(folder)
        mount(folder, (about.f_blocks - about.f_bfree) * about.f_frsize + room, again=True)
        before = marks(folder)
        done = run(*arguments, folder=folder, module=module)
        words = problems(done, before, folder)
        mount(folder, ROOM, again=True)
        return "; ".join(words + again(name, folder, done))

    return Trial(f"{name} with {room} bytes of room", apart(work))


def of_closed_folders(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Let a writer's folder be one that it cannot write."""
    for number in itertools.count():
        yield closed(choose(rng), rng.choice(("mounted so", "of somebody else")), place / str(number))


def closed(name: str, how: str, folder: Path) -> Trial:
    """Run a writer in a folder that cannot be written."""
    folder.mkdir(parents=True)
    module, arguments, _ = WRITERS[name]
    whole(name)
    before_start: Callable[[], None] = nobody if how == "of somebody else" else lambda: None

    def work() -> str:
        mount(folder)
        shutil.copytree(library(), folder, dirs_exist_ok=True)
        folder.chmod(0o755)
        mount(folder, again=True, read_only=how == "mounted so")
        before = marks(folder)
        done = run(*arguments, folder=folder, module=module, before=before_start)
        words = problems(done, before, folder)
        mount(folder, again=True)
        return "; ".join(words + again(name, folder, done))

    return Trial(f"{name} in a folder {how}", apart(work))


def nobody() -> None:
    """Be a user who owns nothing; root may write everywhere."""
    os.environ["HOME"] = "/nonexistent"
    if os.getuid() == 0:
        os.setgroups([])
        os.setresgid(NOBODY, NOBODY, NOBODY)
        os.setresuid(NOBODY, NOBODY, NOBODY)
