"""SIGKILL at any moment: the same command, given again until it comes through, leaves what it would have.

A run or a study is started and killed, again and again, and then let come through. It is killed after a
random time, or by itself before one of its steps that change the file system, counted from its start: a
time alone would seldom meet the moment between two of those. Of a study the whole group is killed, or only
the process that was started, or only the grid that it has started.

Survived: the command that comes through ends with exit code 0, without a traceback; every file has the bytes
that it has without a kill, but for times; and no file is there that is not there without a kill, but a
draft outside the folders of runs: of a kill while one was written, which nothing reads.
"""

import itertools
import os
import random
import re
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.faults.command import Child, run
from tests.faults.runs import ALONE, SHORT, STUDY, TRANSFER, a_folder, undisturbed, wanted
from tests.faults.trial import DRAFT, Trial, difference, state
from tests.study.commands import descendants

# What changes a folder, as Python reports it to an audit hook before it does so.
CHANGES = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.chmod", "os.truncate"}
WRITES = os.O_WRONLY | os.O_RDWR
# A command is let come through after at most so many kills.
MOST = 24


def changes(event: str, arguments: tuple[object, ...], below: str) -> bool:
    """Whether an event changes something below a folder."""
    if event not in CHANGES or not isinstance(arguments[0], str | os.PathLike):
        return False
    if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & WRITES):
        return False
    return str(Path.cwd() / os.fspath(arguments[0])).startswith(below)


def die_at(step: int) -> Callable[[], None]:
    """Let a child be killed before the step of that number, from 0, that changes its folder."""

    def install() -> None:
        below, count = str(Path.cwd()), itertools.count()

        def hook(event: str, arguments: tuple[object, ...]) -> None:
            if changes(event, arguments, below) and next(count) == step:
                os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(hook)

    return install


def steps(arguments: tuple[str, ...]) -> int:
    """Count the steps of a run that change its folder."""

    def install() -> None:
        below = str(Path.cwd())
        with (Path.cwd() / "steps").open("w", buffering=1) as file:
            os.set_inheritable(file.fileno(), True)
            kept = os.dup(file.fileno())

        def hook(event: str, given: tuple[object, ...]) -> None:
            if changes(event, given, below):
                os.write(kept, b".")

        sys.addaudithook(hook)

    folder = a_folder(undisturbed(arguments)[0], 1)
    done = run(*arguments, folder=folder, before=install)
    count = (folder / "steps").stat().st_size
    shutil.rmtree(folder)
    assert done.code == 0 and count > 0, done
    return count


def of_runs(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Kill single runs."""
    counts = {arguments: steps(arguments) for arguments in (ALONE, TRANSFER)}
    for number in itertools.count():
        arguments = rng.choice((ALONE, TRANSFER))
        folder, seconds = a_folder(place, number), undisturbed(arguments)[1]
        kills, words, done = 0, [], None
        for _ in range(rng.randint(1, MOST)):
            if rng.random() < 0.5:
                step = rng.randrange(counts[arguments])
                done = run(*arguments, folder=folder, before=die_at(step))
                words.append(f"step {step}")
            else:
                after = rng.uniform(0, seconds)
                child = Child(arguments, folder)
                done = child.wait(after) or child.kill()
                words.append(f"{after:.2f} s")
            assert done is not None
            if done.code != -signal.SIGKILL:
                break
            kills += 1
        what = f"{folder}: {' '.join(arguments[len(SHORT) :])}: killed at {', '.join(words)}"
        yield conclude(done if done and done.code else None, arguments, "ship_trl", folder, what, kills)


def of_studies(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Kill studies: the whole group, the process that was started, or the grid alone."""
    for number in itertools.count():
        folder, seconds = a_folder(place, number), undisturbed(STUDY, "ship_trl.study")[1]
        kills, words = 0, []
        for _ in range(rng.randint(1, MOST)):
            child = Child(STUDY, folder, "ship_trl.study")
            after, whom = rng.uniform(0, 0.7 * seconds), rng.choice(("group", "parent", "grid"))
            if child.wait(after) is not None:
                break
            words.append(f"{whom} after {after:.1f} s")
            kills += 1
            if whom == "grid":
                for process in descendants(child.pid):
                    if process != child.pid:
                        os.kill(process, signal.SIGKILL)
                after = rng.uniform(0, 3)
                if child.wait(after) is not None:
                    break
                words[-1] += f", group {after:.1f} s later"
                kills += 1
            child.kill(group=whom != "parent")
        what = f"{folder}: study: killed {', '.join(words)}"
        yield conclude(None, STUDY, "ship_trl.study", folder, what, kills)


def without_drafts(found: dict[str, bytes]) -> dict[str, bytes]:
    """Leave out the drafts that no run's folder holds; in those a run begins anew."""
    return {
        name: data
        for name, data in found.items()
        if not DRAFT.search(name) or re.search(r"(^|/)seed=\d+/", name)
    }


def conclude(
    ended: object, arguments: tuple[str, ...], module: str, folder: Path, what: str, kills: int
) -> Trial:
    """Let a command come through, and compare what it left; `ended` is one that failed without a kill."""
    lost = ""
    if ended is not None and getattr(ended, "code", 0) not in (0, -signal.SIGKILL):
        lost = str(ended)
    else:
        started = time.monotonic()
        done = run(*arguments, folder=folder, module=module)
        if done.code != 0 or "Traceback" in done.err:
            lost = f"it does not come through ({time.monotonic() - started:.0f} s): {done}"
        else:
            lost = difference(wanted(arguments, module), without_drafts(state(folder)))
    if not lost:
        shutil.rmtree(folder)
    return Trial(what, lost, kills)
