"""Start two commands at once that need the same run, or the same source of the case base.

Passed: both end with exit code 0, unless one was killed, and all files have the same bytes as after one
command following the other. Without a kill, the source was trained only once; of two equal commands one
trained, and the other showed the finished run.
"""

import itertools
import random
import time
from collections.abc import Iterator
from pathlib import Path

from tests.faults.samples import ALONE, SHORT, TRANSFER, expected, new_folder, undisturbed
from tests.faults.trial import Trial, conclude, contents, difference, drop_drafts
from tests.forked import Child, run

OTHER = (*SHORT, "source=near", "target=met", "method=feature_extraction", "layers=2")
PAIRS = {
    "the same run": (ALONE, ALONE),
    "the same transfer": (TRANSFER, TRANSFER),
    "two transfers of a source": (TRANSFER, OTHER),
    "a source and its transfer": (ALONE, TRANSFER),
}


def trials(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Start the second command a moment later, and sometimes kill the first."""
    for number in itertools.count():
        seconds = undisturbed(TRANSFER)[1].seconds
        pause = rng.choice((0.0, rng.uniform(0, 0.2), rng.uniform(0, seconds)))
        kill = rng.uniform(0, seconds) if rng.random() < 0.3 else None
        yield trial(rng.choice(list(PAIRS)), pause, kill, new_folder(place, number))


def trial(name: str, pause: float, kill: float | None, folder: Path) -> Trial:
    """Start two commands with a pause between them, and kill the first after `kill` seconds more."""
    first = Child(PAIRS[name][0], folder)
    time.sleep(pause)
    second = Child(PAIRS[name][1], folder)
    ended = [first.finish()] if kill is None else [first.wait(kill) or first.kill()]
    ended.append(second.finish())
    if kill is not None and ended[0].code != 0:
        ended[0] = run(*PAIRS[name][0], folder=folder)
    problems = [str(one) for one in ended if one.code != 0 or "Traceback" in one.err]
    if kill is None and not problems:
        out = "".join(one.out for one in ended)
        if out.count("training the source first") > 1:
            problems.append("the source was trained twice")
        if "same" in name and (shown := out.count("is already finished")) != 1:
            problems.append(f"{shown} of two showed a finished run")
    if not problems and (found := difference(expected(*PAIRS[name]), drop_drafts(contents(folder)))):
        problems.append(found)
    what = f"{name}, {pause:.2f} s apart" + (f", the first killed at {kill:.2f} s" if kill else "")
    return conclude(folder, what, problems)
