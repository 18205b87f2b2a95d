"""Two processes at once on one output folder, and on one entry of the case base.

The same command twice, or two transfers from the same source, are started within a moment of each other; now
and then the first is killed.

Survived: both end with exit code 0 (but one that was killed), without a traceback, and every file has the
bytes that it has where one command follows the other. Where none is killed the source was trained once, and
of the same command twice one trained and the other showed the finished run.
"""

import itertools
import random
import shutil
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from tests.faults.command import Child, run
from tests.faults.kills import without_drafts
from tests.faults.runs import ALONE, SHORT, TRANSFER, a_folder, undisturbed
from tests.faults.trial import Trial, difference, state

OTHER = (*SHORT, "source=near", "target=met", "method=feature_extraction", "layers=2")
PAIRS = {
    "the same run": (ALONE, ALONE),
    "the same transfer": (TRANSFER, TRANSFER),
    "one source": (TRANSFER, OTHER),
    "a source and its transfer": (ALONE, TRANSFER),
}


@cache
def one_after_the_other(name: str) -> dict[str, bytes]:
    """Give what two commands leave that follow each other."""
    folder = a_folder(Path(mkdtemp(prefix="faults-")), 0)
    for arguments in PAIRS[name]:
        done = run(*arguments, folder=folder)
        assert done.code == 0, done
    return state(folder)


def of_two(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Start two at once."""
    for number in itertools.count():
        name = rng.choice(list(PAIRS))
        seconds = undisturbed(TRANSFER)[1]
        later = rng.choice((0.0, rng.uniform(0, 0.2), rng.uniform(0, seconds)))
        killed = rng.uniform(0, seconds) if rng.random() < 0.3 else None
        yield two(name, later, killed, a_folder(place, number))


def two(name: str, later: float, killed: float | None, folder: Path) -> Trial:
    """Start two, the second later by so many seconds, and kill the first after so many more."""
    first = Child(PAIRS[name][0], folder)
    time.sleep(later)
    second = Child(PAIRS[name][1], folder)
    if killed is not None:
        ended = first.wait(killed) or first.kill()
        dones = [second.finish(300.0)]
        if ended is not None and ended.code != 0:
            # Whatever it was at is left to do.
            dones.append(run(*PAIRS[name][0], folder=folder))
    else:
        dones = [first.finish(300.0), second.finish(300.0)]
    words = [str(done) for done in dones if done.code != 0 or "Traceback" in done.err]
    said = "".join(done.out for done in dones)
    if killed is None and not words:
        trained, shown = said.count("two trainings"), said.count("holds this run already")
        if trained > 1:
            words.append("the source was trained twice")
        if "same" in name and shown != 1:
            words.append(f"{shown} of two showed a finished run")
    if not words:
        words = [difference(one_after_the_other(name), without_drafts(state(folder)))]
    lost = "; ".join(filter(None, words))
    if not lost:
        shutil.rmtree(folder)
    what = f"{folder}: {name}, {later:.2f} s later" + (
        f", first killed after {killed:.2f} s" if killed else ""
    )
    return Trial(what, lost)
