"""Clocks that jump while a run goes on: the wall clock by a second, an hour or thirty years, others ahead.

`time.time` jumps back and ahead, as when somebody sets the clock. `time.monotonic` and `time.perf_counter`,
by which checkpoints are due and a training is timed, never go back; they leap ahead, as over a machine's
sleep. What is there already may be of the future.

Survived: the command ends with exit code 0, without a traceback, and every file has the bytes that it has
without a jump, but for times; what was finished before is shown again and not trained again. A trial in which
checkpoint and journal never asked a clock that jumps proves nothing, and counts as lost.
"""

import itertools
import mmap
import os
import random
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from ship_trl.run.checkpoint import Checkpoints
from tests.faults.command import run
from tests.faults.runs import ALONE, TRANSFER, a_folder, undisturbed, wanted
from tests.faults.trial import Trial, difference, state

JUMPS = (-1e9, -86400.0, -3600.0, -1.0, 3600.0, 1e9)
STEADY = ("monotonic", "perf_counter")
# Whose questions count.
ASKING = {"ship_trl.run.checkpoint", "ship_trl.run.journal"}
# Checkpoints that wait for the clock, beside those after every episode.
WAITING = "checkpoint.seconds=60"


def jumping(jumps: list[tuple[float, float]], asked: mmap.mmap) -> Callable[[], None]:
    """Let the clocks of a child jump by so much after so many seconds each, and note who asked them."""
    real = {name: getattr(time, name) for name in ("time", *STEADY)}

    def clock(name: str, begun: float) -> Callable[[], float]:
        def now() -> float:
            if sys._getframe(1).f_globals.get("__name__") in ASKING:
                asked[0] = 1
            passed = real["monotonic"]() - begun
            leaps = (by for after, by in jumps if passed >= after and (by > 0 or name not in STEADY))
            return float(real[name]()) + sum(leaps)

        return now

    def install() -> None:
        clocks = {name: clock(name, real["monotonic"]()) for name in real}
        vars(time).update(clocks)
        vars(time)["time_ns"] = lambda: int(clocks["time"]() * 1e9)
        # The clock that it takes if it is given none was bound when it was defined.
        bound = Checkpoints.__init__.__defaults__ or ()
        Checkpoints.__init__.__defaults__ = tuple(
            clocks["monotonic"] if value is real["monotonic"] else value for value in bound
        )

    return install


def of_clocks(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Let the clocks jump while a run goes on."""
    for number in itertools.count():
        arguments = rng.choice((ALONE, TRANSFER, (*ALONE, WAITING), (*TRANSFER, WAITING)))
        seconds = undisturbed(arguments)[1]
        jumps = [(rng.uniform(0, seconds), rng.choice(JUMPS)) for _ in range(rng.randint(1, 3))]
        yield one(arguments, jumps, rng.random() < 0.3, a_folder(place, number))


def one(arguments: tuple[str, ...], jumps: list[tuple[float, float]], future: bool, folder: Path) -> Trial:
    """Run a command, where what it found is of the `future` already finished."""
    if future:
        shutil.copytree(undisturbed(arguments)[0], folder, dirs_exist_ok=True)
        for path in folder.rglob("*"):
            os.utime(path, (time.time() + 86400,) * 2)
    with mmap.mmap(-1, mmap.PAGESIZE) as asked:
        done = run(*arguments, folder=folder, before=jumping(jumps, asked))
        heard = bool(asked[0])
    lost = difference(wanted(arguments), state(folder))
    if done.code != 0 or done.err:
        lost = str(done)
    elif future and "holds this run already" not in done.out:
        lost = "it was trained again"
    elif not future and not heard:
        lost = "no clock that jumps was asked"
    if not lost:
        shutil.rmtree(folder)
    said = ", ".join(f"{by:g} s after {after:.1f} s" for after, by in jumps)
    return Trial(f"{folder}: {said}", lost, len(jumps))
