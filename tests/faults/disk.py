"""Fill the disk while a command writes: it reports an error, and loses nothing.

Either no file or folder can be made from some step on, or no file can grow past some size.
Passed: the command ends with exit code 0 or as a refusal; older files are unchanged; no draft is left. The
same command then ends with exit code 0, and leaves the same bytes as without a fault.
"""

import itertools
import random
import resource
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

from tests.faults.changes import counted, full_at
from tests.faults.samples import ALONE, RUN, STUDY, TRANSFER, copy_samples, marks
from tests.faults.trial import DRAFT, Trial, conclude, contents, difference
from tests.forked import run

COMMANDS = {
    "run": (*ALONE, "output=new"),
    "transfer": (*TRANSFER, "output=new"),
    "report": ("report", "study"),
    "keep": ("keep", "study", "copy"),
    "restore": ("keep", "--restore", "tables", "again"),
    "record": ("record", RUN, "--output", "film.gif", "--trajectories", "chart.png"),
    "results": ("results", "outputs", "--picture", "curves.png", "--csv", "numbers.csv"),
    "cases": ("cases", "target=met"),
    "study": STUDY,
}
# Output of a command must fit.
MIN_SIZE = 4096


@cache
def undisturbed(name: str) -> tuple[dict[str, bytes], int, int]:
    """Run a command in a copy of the samples; return what it leaves, its steps, and its largest file."""
    folder = copy_samples(Path(mkdtemp(prefix="faults-")) / "whole")
    before = marks(folder)
    with TemporaryDirectory() as place:
        ended = run(*COMMANDS[name], folder=folder, before=counted(Path(place) / "steps"))
        steps = (Path(place) / "steps").stat().st_size
    assert ended.code == 0, ended
    written = [size for path, (_, size, _) in marks(folder).items() if path not in before]
    return contents(folder), steps, max(written)


def small_files(size: int) -> Callable[[], None]:
    """Let no file of the child grow past a size."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def trials(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Fill the disk of a random command."""
    # Each study takes as long as ten others.
    names = [name for name in COMMANDS if name != "study"]
    for number in itertools.count():
        name = "study" if number % 20 == 19 else rng.choice(names)
        _, steps, size = undisturbed(name)
        if rng.random() < 0.6:
            step = rng.randrange(steps)
            yield trial(name, f"full at step {step}", full_at(step), place / str(number))
        else:
            most = rng.randrange(MIN_SIZE, max(size, MIN_SIZE + 1))
            yield trial(name, f"files of {most} bytes", small_files(most), place / str(number))


def trial(name: str, what: str, fault: Callable[[], None], folder: Path) -> Trial:
    """Run a command with a fault, and again without."""
    words, wanted = COMMANDS[name], undisturbed(name)[0]
    before = marks(copy_samples(folder))
    ended = run(*words, folder=folder, before=fault)
    after = marks(folder)
    problems = [] if ended.code == 0 or ended.is_refusal else [f"not explained: {ended}"]
    changed = [path for path in before if after.get(path) != before[path]]
    problems += [f"{path} is lost" for path in changed if "lock" not in path]
    problems += [f"{path} is left behind" for path in after.keys() - before.keys() if DRAFT.search(path)]
    if ended.code != 0:
        ended = run(*words, folder=folder)
    problems += [f"then {ended}"] if ended.code != 0 else []
    problems += [f"then {found}"] if (found := difference(wanted, contents(folder))) else []
    return conclude(folder, f"{name}, {what}", problems)
