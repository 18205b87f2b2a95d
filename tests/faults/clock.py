"""A clock that jumps: back by a second, an hour or thirty years, or ahead, while a command runs.

`time.time` jumps, before the command and while it runs, and what is there already may be of the future.

Survived: the command ends with exit code 0, without a traceback, and every file has the bytes that it has
without a jump, but for times; what was finished before is shown again and not trained again.
"""

import itertools
import os
import random
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.faults.command import run
from tests.faults.runs import ALONE, TRANSFER, a_folder, undisturbed, wanted
from tests.faults.trial import Trial, difference, state

JUMPS = (-1e9, -86400.0, -3600.0, -1.0, 3600.0, 1e9)


def jumping(jumps: list[tuple[float, float]]) -> Callable[[], None]:
    """Let the clock of a child jump by so much after so many seconds each."""

    def install() -> None:
        real, started = time.time, time.monotonic()

        def now() -> float:
            passed = time.monotonic() - started
            return real() + sum(by for after, by in jumps if passed >= after)

        vars(time)["time"] = now
        vars(time)["time_ns"] = lambda: int(now() * 1e9)

    return install


def of_clocks(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Let the clock jump while a run goes on."""
    for number in itertools.count():
        arguments = rng.choice((ALONE, TRANSFER))
        seconds = undisturbed(arguments)[1]
        jumps = [(rng.uniform(0, seconds), rng.choice(JUMPS)) for _ in range(rng.randint(1, 3))]
        yield one(arguments, jumps, rng.random() < 0.3, a_folder(place, number))


def one(arguments: tuple[str, ...], jumps: list[tuple[float, float]], future: bool, folder: Path) -> Trial:
    """Run a command, where what it found is of the `future` already finished."""
    if future:
        shutil.copytree(undisturbed(arguments)[0], folder, dirs_exist_ok=True)
        for path in folder.rglob("*"):
            os.utime(path, (time.time() + 86400,) * 2)
    done = run(*arguments, folder=folder, before=jumping(jumps))
    lost = difference(wanted(arguments), state(folder))
    if done.code != 0 or done.err:
        lost = str(done)
    elif future and "holds this run already" not in done.out:
        lost = "it was trained again"
    if not lost:
        shutil.rmtree(folder)
    said = ", ".join(f"{by:g} s after {after:.1f} s" for after, by in jumps)
    return Trial(f"{folder}: {said}", lost, len(jumps))
