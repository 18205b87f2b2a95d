"""Damaged and hostile files: what a command reads it works with, or refuses in lines of ours.

A library holds one of each file that we read: two cases, a finished transfer and its source, their entries in
the case base, a kept plan, a stopped run with its checkpoints, demonstrations, a study and its tables, and
what a report or a comparison of layers has measured. In a copy of it one file is damaged (`damage.py`), and a
command that reads it is run.

Survived: the command ends with exit code 0, or with code 1 and nothing on stderr but lines that begin with
`ship_trl: `; without a traceback; in thrice the time that it takes otherwise and half a minute; in 3 GiB
more memory than it begins with. Nothing that was there is lost, but what the command is to replace; no
draft is left behind; and nothing has been executed.
"""

import csv
import itertools
import os
import random
import resource
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.plan.config import to_study
from ship_trl.study.plan.jobs import plan_jobs
from ship_trl.study.plan.manifest import write_plan
from ship_trl.study.records.layers import Layer, write_layers
from ship_trl.transfer.measured import COLUMNS as TRANSFERS
from ship_trl.transfer.measured import Transfer
from tests.faults.command import Done, run
from tests.faults.damage import DAMAGES, EXECUTED
from tests.faults.kills import die_at, steps
from tests.faults.runs import ALONE, STUDY, TRANSFER, a_folder, undisturbed
from tests.faults.trial import DRAFT, Trial
from tests.study.synthetic import learning, write_run

OUTPUT = "outputs/smoke"
SOURCE, RUN = f"{OUTPUT}/near/scratch/seed=0", f"{OUTPUT}/near-met/FT3/seed=0"
STOPPED = "stopped/near/scratch/seed=0"
# Bytes, seconds.
MEMORY, PATIENCE = 3 << 30, 30.0


@dataclass(frozen=True)
class Reader:
    """A command, the files of the library that it reads, and those that it is to replace."""

    module: str
    arguments: tuple[str, ...]
    reads: tuple[str, ...]
    replaces: tuple[str, ...] = ()
    # Taken away first, so that the command has something to do.
    without: str = ""


@cache
def library() -> Path:
    """Make one of each file, and the two other runs that a grid would have made."""
    folder = a_folder(Path(mkdtemp(prefix="faults-")), 0)
    shutil.copytree(undisturbed(TRANSFER)[0], folder, dirs_exist_ok=True)
    shown = ("keep_course", "target=met", "--demonstrations", "shown")
    done = run(*shown, folder=folder, verb="evaluate")
    assert done.code == 0, done
    stop_a_run(folder)
    place = folder / "study"
    config = to_study([*STUDY, f"output={place}"])
    jobs = plan_jobs(config)
    write_plan(jobs, config)
    for job in jobs:
        scores = learning(np.random.default_rng(job.seed), 30)
        write_run(place / job.part, scores, pair=job.label, arm=job.arm, seed=job.seed)
    done = run("study", "tables", folder=folder, verb="keep")
    assert done.code == 0, done
    measured(folder)
    return folder


def measured(folder: Path) -> None:
    """Write the tables of measurements: layers beside the study's tables, verdicts, transfers."""
    rows = [Layer(seed, "high", "FE3", "source", f"conv.{n}", 0.9) for seed in range(2) for n in range(4)]
    write_layers(folder / "tables/layers.csv", rows)
    place = folder / "measured"
    place.mkdir()
    (place / "claims.csv").write_text("claim,claim's verdict,sentence\nH5a,inconclusive,FE3 is best.\n")
    near, met = (load_case(str(folder / f"conf/case/{name}.yaml"), load_world()) for name in ("near", "met"))
    found = Transfer("near", "met", near.fingerprint, met.fingerprint, "smoke", "FT3", None, 5, 0.2, 0.1, 0.3)
    with (place / "transfers.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, TRANSFERS)
        writer.writeheader()
        writer.writerow(asdict(found))


def stop_a_run(folder: Path) -> None:
    """Leave a run that was killed when it had written both generations of checkpoints, before it ended."""
    for step in reversed(range(steps(ALONE))):
        shutil.rmtree(folder / "stopped", ignore_errors=True)
        run(*ALONE, "output=stopped", folder=folder, before=die_at(step))
        there = {path.name for path in (folder / STOPPED).rglob("*")}
        if {"1.safetensors", "2.safetensors"} <= there and "result.json" not in there:
            return
    raise AssertionError("no kill left two checkpoints")


def readers() -> dict[str, Reader]:
    """Give the commands by name."""
    run_files = tuple(f"{RUN}/{name}" for name in ("result.json", "config.yaml", "policy.safetensors"))
    case = "conf/case/met.yaml"
    base = tuple(
        f"{OUTPUT}/case_base/near/*/*/{name}" for name in ("entry.json", "policy.safetensors", "config.yaml")
    )
    judged = ("study/study.json", "study/*/*/*/*/result.json", "study/*/*/*/*/curve.csv")
    tables = ("tables/study.json", "tables/runs.csv", "tables/curves.csv.xz")
    fresh = tuple(word for word in TRANSFER if not word.startswith(("source=", "method=", "layers=")))
    return {
        "evaluate": Reader("ship_trl.evaluate", (RUN,), (*run_files, case)),
        "evaluate a file": Reader(
            "ship_trl.evaluate", (f"{RUN}/policy.safetensors", "target=met"), (run_files[2], case)
        ),
        "results": Reader("ship_trl.results", ("outputs",), (run_files[0],)),
        "results, all": Reader(
            "ship_trl.results",
            ("outputs", "--stability", "--picture", "p.png", "--csv", "n.csv"),
            (f"{RUN}/result.json", f"{RUN}/curve.csv"),
        ),
        "cases": Reader("ship_trl.cases", ("--target", "met"), (case, "conf/case/near.yaml")),
        "cases, case base": Reader(
            "ship_trl.cases",
            ("--target", "met", "--no-picture", "--case-base", f"{OUTPUT}/case_base"),
            base[:1],
        ),
        "cases, measured": Reader(
            "ship_trl.cases",
            ("--target", "met", "--no-picture", "--measured", "measured/transfers.csv"),
            ("measured/transfers.csv",),
        ),
        "record": Reader(
            "ship_trl.record",
            (RUN, "--trajectories", "chart.png"),
            (*run_files, case),
        ),
        "export": Reader("ship_trl.export", (RUN, "model.onnx"), (*run_files, case)),
        "report": Reader("ship_trl.report", ("study",), judged),
        "report of tables": Reader("ship_trl.report", ("tables", "--output", "page"), tables),
        "report beside an earlier one": Reader(
            "ship_trl.report",
            ("tables", "--output", "page", "--earlier", "measured/claims.csv"),
            ("measured/claims.csv", "tables/layers.csv"),
        ),
        "keep": Reader("ship_trl.cli.keep", ("study", "copy"), judged),
        "restore": Reader("ship_trl.cli.keep", ("--restore", "tables", "again"), tables),
        "a run again": Reader("ship_trl", TRANSFER, (*run_files, f"{RUN}/curve.csv", case), (f"{RUN}/*",)),
        "a stopped run": Reader(
            "ship_trl",
            (*ALONE, "output=stopped"),
            (f"{STOPPED}/checkpoint/*", f"{STOPPED}/curve.csv", f"{STOPPED}/config.yaml"),
            ("stopped/*",),
        ),
        "a transfer from the case base": Reader(
            "ship_trl",
            TRANSFER,
            (*base, f"{SOURCE}/result.json", f"{OUTPUT}/case_base/.plans/*.json", "conf/case/near.yaml"),
            (f"{SOURCE}/*", f"{OUTPUT}/case_base/near/*", f"{OUTPUT}/case_base/.plans/*"),
            without=RUN,
        ),
        "a transfer from a file": Reader(
            "ship_trl",
            (*TRANSFER, f"source_file='{SOURCE}/policy.safetensors'", "output=other"),
            (f"{SOURCE}/policy.safetensors",),
        ),
        "demonstrations": Reader(
            "ship_trl",
            (
                *(w for w in fresh if "max_steps" not in w),
                "method=scratch",
                "demonstrations=shown",
                "output=o",
            ),
            ("shown/met-001.json",),
        ),
        "explain": Reader("ship_trl.explain", (RUN, "--episodes", "60"), (*run_files, f"{RUN}/curve.csv")),
    }


# Commands of half a minute; the others come by turns.
SLOW = {"explain", "export"}


def limited(seconds: float) -> Callable[[], None]:
    """Let a child have so much memory and so many seconds of a processor."""

    def limit() -> None:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 2))

    return limit


def marks(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Give of every file which one it is, its size, and when it was changed."""
    found = {}
    for parent, _, names in os.walk(folder):
        for name in names:
            path = Path(parent, name)
            about = path.lstat()
            found[str(path.relative_to(folder))] = about.st_ino, about.st_size, about.st_mtime_ns
    return found


@cache
def usual(name: str) -> float:
    """Run a reader on the undamaged library; returns how many seconds it takes."""
    done, _ = read(name, Path(mkdtemp(prefix="faults-")) / "whole", lambda _: "", 300.0)
    assert done.code == 0, done
    return done.seconds


def read(name: str, folder: Path, damage: Callable[[Path], str], limit: float) -> tuple[Done, str]:
    """Copy the library, damage it, and run a reader; returns how it ended, and what is lost by that."""
    reader = readers()[name]
    shutil.copytree(library(), folder, symlinks=True, copy_function=os.link)
    if reader.without:
        shutil.rmtree(folder / reader.without)
    damage(folder)
    before = marks(folder)
    done = run(
        *reader.arguments, folder=folder, module=reader.module, before=limited(limit), limit=limit + PATIENCE
    )
    after = marks(folder)
    kept = set(after.values())
    words = []
    if done.code is None:
        words.append("it does not end")
    elif "Traceback" in done.err or "Traceback" in done.out:
        words.append("a traceback")
    elif done.code != 0 and not done.explained:
        words.append("neither exit code 0 nor lines of ours")
    words += [
        f"{path} is gone"
        for path, mark in before.items()
        if mark not in kept
        and not path.endswith((".lock", "log.txt"))
        and not any(fnmatch(path, own) for own in reader.replaces)
    ]
    words += [f"{path} is left behind" for path in after.keys() - before.keys() if DRAFT.search(path)]
    if list(folder.rglob(EXECUTED)) or Path(EXECUTED).exists():
        words.append("something was executed")
    return done, "; ".join(words)


def of_files(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Damage a file, and run a command that reads it."""
    quick = [name for name in readers() if name not in SLOW]
    for number in itertools.count():
        slow = number % 40 == 39
        name = rng.choice(sorted(SLOW)) if slow else quick[number % len(quick)]
        yield one(name, rng, place / str(number))


def one(name: str, rng: random.Random, folder: Path) -> Trial:
    """Damage one file that a reader reads, and run it."""
    words: list[str] = []

    def damage(copy: Path) -> str:
        pattern = rng.choice(readers()[name].reads)
        path = rng.choice(sorted(copy.glob(pattern)))
        words.append(str(path.relative_to(copy)))
        words.append(rng.choice(DAMAGES)(path, rng))
        return ""

    limit = 3 * usual(name) + 10
    done, lost = read(name, folder, damage, limit)
    if not lost:
        shutil.rmtree(folder)
    return Trial(f"{folder}: {name}: {': '.join(words)}", f"{lost}: {done}" if lost else "")
