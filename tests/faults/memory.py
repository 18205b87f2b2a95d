"""The memory of a study's grid running out, or the grid being killed for it.

While a study runs, the process of its grid may have no more memory from some moment on, or is killed as the
kernel would kill it. A single run has too little from the start.

Survived: the study ends with exit code 0, or with code 1 and, as its last line on stderr, how many runs have
no result. A single run may end as it likes. The same command again ends with exit code 0, and every file has
the bytes that it has without a fault.
"""

import itertools
import os
import random
import resource
import shutil
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from tests.faults.command import Child, run
from tests.faults.kills import conclude
from tests.faults.runs import STUDY, TRANSFER, a_folder, undisturbed
from tests.faults.trial import Trial
from tests.study.commands import descendants

MIB = 1 << 20


def pages(process: int) -> int:
    """Bytes that a process has mapped."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[0]) * resource.getpagesize()


def of_studies(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Take a grid's memory, or end it."""
    for number in itertools.count():
        yield (
            a_study(rng, a_folder(place, number)) if number % 4 == 3 else a_run(rng, a_folder(place, number))
        )


def a_run(rng: random.Random, folder: Path) -> Trial:
    """Let a run have so much more than it begins with."""
    more = rng.randrange(200) * MIB

    def limit() -> None:
        most = pages(os.getpid()) + more
        resource.setrlimit(resource.RLIMIT_AS, (most, most))

    done = run(*TRANSFER, folder=folder, before=limit)
    what = f"{folder}: a run with {more // MIB} MiB more"
    return conclude(None if done.code else done, TRANSFER, "ship_trl", folder, what, 1)


def a_study(rng: random.Random, folder: Path) -> Trial:
    """Take the memory of what a study has started, after a while."""
    child = Child(STUDY, folder, "ship_trl.study")
    after = rng.uniform(0, 0.8 * undisturbed(STUDY, "ship_trl.study")[1])
    how = rng.choice(("killed", "no more memory"))
    words = []
    if child.wait(after) is None:
        for process in descendants(child.pid):
            if process != child.pid:
                with suppress(OSError):
                    words.append(str(process))
                    if how == "killed":
                        os.kill(process, signal.SIGKILL)
                    else:
                        most = pages(process) + rng.randrange(50) * MIB
                        resource.prlimit(process, resource.RLIMIT_AS, (most, most))
    done = child.finish(300.0)
    what = f"{folder}: a study, {how} after {after:.1f} s"
    if done.code not in (0, 1) or (done.code == 1 and not done.err.strip().splitlines()[-1:]):
        return Trial(what, str(done))
    if done.code == 1 and "ship_trl: " not in done.err.strip().splitlines()[-1]:
        return Trial(what, str(done))
    trial = conclude(None, STUDY, "ship_trl.study", folder, what, 1)
    if trial.lost:
        return trial
    shutil.rmtree(folder, ignore_errors=True)
    return trial
