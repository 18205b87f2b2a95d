"""The memory of a study's grid running out, or the grid being killed for it.

While a study runs, the process of its grid may have no more memory from some moment on, or is killed as the
kernel would kill it. A single run has too little from the start.

Survived: the study ends with exit code 0, or with code 1 and, as its last line on stderr, how many runs have
no result, which is right. Where the fault met the short runs by which it measures how long it will take
(`study/launch/pace.py`), before any run was begun, it says in that line why those failed. A single run may
end as it likes. The same command again ends with exit code 0, and every file has the bytes that it has
without a fault.
"""

import itertools
import os
import random
import re
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
# What a study says at its end, and what it says of the short runs that it measures by.
MISSING = re.compile(r"ship_trl: (\d+) of (\d+) runs have no result \(.+ \.\.\.\); see .+")
NOT_MEASURED = re.compile(r"ship_trl: overrides: .+")


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
    done = child.wait(after)
    if done is None:
        for process in descendants(child.pid):
            if process != child.pid:
                with suppress(OSError):
                    if how == "killed":
                        os.kill(process, signal.SIGKILL)
                    else:
                        most = pages(process) + rng.randrange(50) * MIB
                        resource.prlimit(process, resource.RLIMIT_AS, (most, most))
        done = child.finish(300.0)
    what = f"{folder}: a study, {how} after {after:.1f} s"
    if done.code != 0 and not (done.code == 1 and explained(done.err, folder)):
        return Trial(what, str(done))
    trial = conclude(None, STUDY, "ship_trl.study", folder, what, 1)
    if trial.lost:
        return trial
    shutil.rmtree(folder, ignore_errors=True)
    return trial


def explained(said: str, folder: Path) -> bool:
    """Whether the last line that a study said tells what is missing in its folder."""
    line = (said.strip().splitlines() or [""])[-1]
    wanted, there = results(undisturbed(STUDY, "ship_trl.study")[0]), results(folder)
    if found := MISSING.fullmatch(line):
        return (int(found[1]), int(found[2])) == (wanted - there, wanted) and there < wanted
    return NOT_MEASURED.fullmatch(line) is not None and there == 0


def results(folder: Path) -> int:
    """Count the runs of a study that have a result."""
    return len(list(folder.rglob("result.json")))
