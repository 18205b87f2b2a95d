"""Damage one file of the samples, and run a command that reads it.

Passed: the command ends with exit code 0 or as a refusal, without a traceback, in time and within the memory
limit; only files that the command replaces are lost; no draft is left; nothing was executed.
"""

import itertools
import random
import resource
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from tests.faults.damage import DAMAGES, EXECUTED
from tests.faults.judge import memory_limit
from tests.faults.samples import ALONE, BASE, RUN, SOURCE, STOPPED, TRANSFER, copy_samples, marks
from tests.faults.trial import DRAFT, Trial, conclude
from tests.forked import Ended, run


@dataclass(frozen=True)
class Command:
    """The words of a command, the files it reads and may replace, and a folder to remove before it."""

    words: tuple[str, ...]
    reads: tuple[str, ...]
    replaces: tuple[str, ...] = ()
    removed: str = ""


CASE = "conf/case/met.yaml"
RUN_FILES = tuple(f"{RUN}/{name}" for name in ("result.json", "config.yaml", "policy.safetensors"))
STUDY_FILES = ("study/study.json", "study/*/*/*/*/result.json", "study/*/*/*/*/curve.csv")
TABLES = ("tables/study.json", "tables/runs.csv", "tables/curves.csv.xz", "tables/layers.csv")
ENTRY_FILES = tuple(f"{BASE}/near/*/*/{name}" for name in ("entry.json", "policy.safetensors", "config.yaml"))
# Demonstrations are of the whole world.
DEMOS = [word for word in (*ALONE, "output=o") if not word.startswith(("world.max_steps", "target"))]
COMMANDS = {
    "evaluate": Command(("evaluate", RUN), (*RUN_FILES, CASE)),
    "results": Command(
        ("results", "outputs", "--stability", "--csv", "n.csv"), (*RUN_FILES, f"{RUN}/curve.csv")
    ),
    "record": Command(("record", RUN, "--trajectories", "chart.png"), (*RUN_FILES, CASE)),
    "cases": Command(("cases", "target=met"), (CASE,)),
    "measured": Command(
        ("cases", "target=met", "--measured", "tables/transfers.csv"), ("tables/transfers.csv",)
    ),
    "report": Command(("report", "study"), STUDY_FILES),
    "report of tables": Command(("report", "tables", "--output", "page"), TABLES),
    "keep": Command(("keep", "study", "copy"), STUDY_FILES),
    "restore": Command(("keep", "--restore", "tables", "again"), TABLES[:3]),
    "a finished run": Command(TRANSFER, (*RUN_FILES, f"{RUN}/curve.csv", CASE), (f"{RUN}/*",)),
    "a stopped run": Command(
        (*ALONE, "output=stopped"),
        (f"{STOPPED}/checkpoint/*", f"{STOPPED}/curve.csv", f"{STOPPED}/config.yaml"),
        ("stopped/*",),
    ),
    "case base": Command(
        TRANSFER,
        (*ENTRY_FILES, f"{SOURCE}/result.json", f"{BASE}/.plans/*.json", "conf/case/near.yaml"),
        (f"{SOURCE}/*", f"{BASE}/near/*", f"{BASE}/.plans/*"),
        removed=RUN,
    ),
    "source file": Command(
        (*TRANSFER, f"source_file='{SOURCE}/policy.safetensors'", "output=other"),
        (f"{SOURCE}/policy.safetensors",),
    ),
    "demonstrations": Command((*DEMOS, "target=met", "demonstrations=demos"), ("demos/met-001.json",)),
}


def limit(seconds: float) -> Callable[[], None]:
    """Limit a child's memory and processor time."""

    def install() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (memory_limit(), memory_limit()))
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 2))

    return install


@cache
def usual_seconds(name: str) -> float:
    """Run a command on the undamaged samples, and return how long it took."""
    ended, problem = read(name, Path(mkdtemp(prefix="faults-")) / "whole", lambda folder: None, 300.0)
    assert ended.code == 0 and not problem, (ended, problem)
    return ended.seconds


def read(name: str, folder: Path, damage: Callable[[Path], None], seconds: float) -> tuple[Ended, str]:
    """Run a command in a damaged copy of the samples; return how it ended, and what is wrong with that."""
    command = COMMANDS[name]
    copy_samples(folder)
    if command.removed:
        shutil.rmtree(folder / command.removed)
    damage(folder)
    before = marks(folder)
    ended = run(*command.words, folder=folder, before=limit(seconds), timeout=seconds + 30)
    after = marks(folder)
    problems = [] if ended.code == 0 or ended.is_refusal else ["neither exit code 0 nor a refusal"]
    problems += ["a traceback"] if "Traceback" in ended.out + ended.err else []
    # A renamed file is kept.
    kept = set(after.values())
    problems += [
        f"{path} is lost"
        for path, mark in before.items()
        if mark not in kept
        and not path.endswith((".lock", "log.txt"))
        and not any(fnmatch(path, own) for own in command.replaces)
    ]
    problems += [f"{path} is left behind" for path in after.keys() - before.keys() if DRAFT.search(path)]
    problems += ["something was executed"] if list(folder.rglob(EXECUTED)) else []
    return ended, "; ".join(problems)


def trials(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Take one command after another."""
    for number in itertools.count():
        yield trial(list(COMMANDS)[number % len(COMMANDS)], rng, place / str(number))


def trial(name: str, rng: random.Random, folder: Path) -> Trial:
    """Damage one file that a command reads, and run it."""
    done: list[str] = []

    def damage(copy: Path) -> None:
        path = rng.choice(sorted(copy.glob(rng.choice(COMMANDS[name].reads))))
        done.append(f"{path.relative_to(copy)} {rng.choice(DAMAGES)(path, rng)}")

    ended, problem = read(name, folder, damage, 3 * usual_seconds(name) + 10)
    return conclude(folder, f"{name}: {done[0]}", [f"{problem}: {ended}"] if problem else [])
