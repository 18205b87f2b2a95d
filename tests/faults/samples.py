"""The small runs and files that faults are tried on: two cases of ten steps, a transfer, a study."""

import csv
import os
import shutil
from dataclasses import asdict
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.manifest import write_plan
from ship_trl.study.plan import plan_jobs, to_study
from ship_trl.study.tables import Layer, write_layers
from ship_trl.study.transfers import COLUMNS, Transfer
from tests.faults.changes import die_before
from tests.faults.trial import contents
from tests.forked import Ended, run
from tests.study.synthetic import learning, write_run

CASES = {
    "near": "start: [0, 0]\nheading: 90\ngoal: [0, 180]\nideal_path: straight\ntarget_ships: []\n",
    "met": (
        "start: [0, 0]\nheading: 90\ngoal: [0, 185]\nideal_path: starboard\n"
        "target_ships: [{x: 60, y: 120, heading: 180, speed: 5}]\n"
    ),
}
# Episodes of ten steps, and a checkpoint after each.
SHORT = (
    *("profile=smoke", "world.max_steps=10", "learn.warmup_steps=20", "learn.jumpstart_draws=2"),
    *("learn.episodes=3", "learn.evaluate_every=2", "checkpoint.seconds=0"),
)
ALONE = (*SHORT, "target=near", "method=scratch")
TRANSFER = (*SHORT, "source=near", "target=met", "method=finetune", "layers=3")
STUDY = (
    *("study", "profile=smoke", "pairs=[high]", "arms=[scratch,FTW]", "reuse=false", "controls=false"),
    *("processes=1", "overrides=[learn.episodes=2,learn.jumpstart_draws=0]"),
)
# Folders of the samples.
OUTPUT = "outputs/smoke"
BASE = f"{OUTPUT}/case_base"
SOURCE, RUN = f"{OUTPUT}/near/scratch/seed=0", f"{OUTPUT}/near-met/FT3/seed=0"
STOPPED = "stopped/near/scratch/seed=0"


def new_folder(place: Path, number: int = 0) -> Path:
    """Make a folder with the two cases, to run a command in."""
    cases = place / str(number) / "conf/case"
    cases.mkdir(parents=True)
    for name, text in CASES.items():
        (cases / f"{name}.yaml").write_text(text)
    return place / str(number)


@cache
def undisturbed(*commands: tuple[str, ...]) -> tuple[Path, Ended]:
    """Run commands one after another without a fault; return their folder, and how the last one ended."""
    folder = new_folder(Path(mkdtemp(prefix="faults-")))
    for words in commands:
        ended = run(*words, folder=folder)
        assert ended.code == 0, ended
    return folder, ended


@cache
def expected(*commands: tuple[str, ...]) -> dict[str, bytes]:
    """Return what commands leave without a fault."""
    return contents(undisturbed(*commands)[0])


@cache
def samples() -> Path:
    """Make a folder with one of each file that we read."""
    folder = new_folder(Path(mkdtemp(prefix="faults-")))
    shutil.copytree(undisturbed(TRANSFER)[0], folder, dirs_exist_ok=True)
    ended = run("evaluate", "keep_course", "target=met", "--demonstrations", "demos", folder=folder)
    assert ended.code == 0, ended
    # A run that was killed after its last checkpoint, before its result.
    ended = run(*ALONE, "output=stopped", folder=folder, before=die_before("result"))
    assert ended.code == -9 and len(list((folder / STOPPED / "checkpoint").iterdir())) == 2, ended
    config = to_study([*STUDY[1:], f"output={folder / 'study'}"])
    jobs = plan_jobs(config)
    write_plan(jobs, config)
    for job in jobs:
        scores = learning(np.random.default_rng(job.seed), 30)
        write_run(folder / "study" / job.part, scores, pair=job.label, arm=job.arm, seed=job.seed)
    ended = run("keep", "study", "tables", folder=folder)
    assert ended.code == 0, ended
    rows = [Layer(seed, "high", "FE3", "source", f"conv.{n}", 0.9) for seed in range(2) for n in range(4)]
    write_layers(folder / "tables/layers.csv", rows)
    near, met = (load_case(str(folder / f"conf/case/{name}.yaml"), load_world()) for name in CASES)
    row = Transfer("near", "met", near.fingerprint, met.fingerprint, "smoke", "FT3", None, 5, 0.2, 0.1, 0.3)
    with (folder / "tables/transfers.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerow(asdict(row))
    return folder


def copy_samples(folder: Path) -> Path:
    """Link the files of the samples into a new folder; to change one, replace it."""
    for source in samples().iterdir():
        if source.is_dir():
            shutil.copytree(source, folder / source.name, symlinks=True, copy_function=os.link)
    return folder


def marks(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Return inode, size and time of each file below a folder."""
    found = {}
    for parent, _, names in os.walk(folder):
        for path in (Path(parent, name) for name in names):
            about = path.lstat()
            found[str(path.relative_to(folder))] = about.st_ino, about.st_size, about.st_mtime_ns
    return found
