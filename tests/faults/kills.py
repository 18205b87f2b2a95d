"""Kill a run or a study at any moment: the same command, given again, completes it.

A run is killed after a random time, or before a random step that changes its folder, because a random time
seldom falls between two steps. For a study, all processes are killed, or its own, or those of its grid.
Passed: the command then ends with exit code 0, all files have the same bytes except for times, and no other
file is left except drafts outside the folders of runs.
"""

import itertools
import os
import random
import signal
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.faults.changes import counted, die_at
from tests.faults.samples import ALONE, STUDY, TRANSFER, expected, new_folder, undisturbed
from tests.faults.trial import Trial, conclude, contents, difference, drop_drafts
from tests.forked import Child, Ended, run
from tests.study.commands import descendants

MAX_KILLS = 24
KILLED = Ended(-signal.SIGKILL, "", "", 0.0)


@cache
def count_steps(words: tuple[str, ...]) -> int:
    """Count the steps of a command that change its folder."""
    with TemporaryDirectory() as place:
        counter = Path(place) / "steps"
        ended = run(*words, folder=new_folder(Path(place)), before=counted(counter))
        assert ended.code == 0, ended
        return counter.stat().st_size


def kill_at_step(words: tuple[str, ...], folder: Path, rng: random.Random) -> tuple[Ended, str]:
    """Kill a command before a step, and say when."""
    step = rng.randrange(count_steps(words))
    return run(*words, folder=folder, before=die_at(step)), f"step {step}"


def kill_in_time(words: tuple[str, ...], folder: Path, rng: random.Random) -> tuple[Ended, str]:
    """Kill a command after a time, and say when."""
    after = rng.uniform(0, undisturbed(words)[1].seconds)
    child = Child(words, folder)
    return child.wait(after) or child.kill(), f"{after:.2f} s"


def kill_part(words: tuple[str, ...], folder: Path, rng: random.Random) -> tuple[Ended, str]:
    """Kill a command, or all its processes, or first those that it has started; say when."""
    after, whom = rng.uniform(0, 0.7 * undisturbed(words)[1].seconds), rng.choice(("all", "parent", "grid"))
    child = Child(words, folder)
    ended = child.wait(after)
    if not ended and whom == "grid":
        for process in set(descendants(child.pid)) - {child.pid}:
            os.kill(process, signal.SIGKILL)
        reported = child.wait(rng.uniform(0, 3))
        ended = KILLED if reported and reported.is_refusal else reported
    return ended or child.kill(whom != "parent"), f"{whom}, {after:.1f} s"


def run_trials(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Kill single runs."""
    for number in itertools.count():
        words = rng.choice((ALONE, TRANSFER))
        yield trial(words, new_folder(place, number), rng, (kill_at_step, kill_in_time))


def study_trials(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Kill studies."""
    for number in itertools.count():
        yield trial(STUDY, new_folder(place, number), rng, (kill_part,))


def trial(
    words: tuple[str, ...],
    folder: Path,
    rng: random.Random,
    how: tuple[Callable[..., tuple[Ended, str]], ...],
) -> Trial:
    """Kill a command again and again, then let it end, and compare what it leaves."""
    kills: list[str] = []
    ended = KILLED
    for _ in range(rng.randint(1, MAX_KILLS)):
        ended, when = rng.choice(how)(words, folder, rng)
        if ended.code != KILLED.code:
            break
        kills.append(when)
    problem = str(ended) if ended.code not in (0, KILLED.code) else finish(words, folder)
    what = f"{' '.join(words)}: killed at {', '.join(kills)}"
    return conclude(folder, what, [problem] if problem else [], len(kills))


def finish(words: tuple[str, ...], folder: Path) -> str:
    """Run a killed command again; return what is wrong with it or with what it leaves."""
    ended = run(*words, folder=folder)
    if ended.code != 0 or "Traceback" in ended.err:
        return f"it does not resume: {ended}"
    return difference(expected(words), drop_drafts(contents(folder)))
