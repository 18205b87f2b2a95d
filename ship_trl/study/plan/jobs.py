"""The runs of a study and their order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ship_trl.config.arm import Arm
from ship_trl.study.plan.arms import (
    CONTROL_ARMS,
    CONTROL_PAIRS,
    FIRST_BLOCK_ARMS,
    FIRST_BLOCK_PAIRS,
    SCRATCH,
    SCRATCH_PAIR,
    WHOLE,
)
from ship_trl.study.plan.config import (
    NEW_CASE,
    REUSED_ARM,
    REUSED_CASE,
    REUSED_PAIR,
    StudyConfig,
    read_option,
)

# A study's parts, which are its folders: figures 5 to 7, figure 9, our controls, and sources of no pair.
PAIRS, REUSE, CONTROLS, SOURCES = "pairs", "reuse", "controls", "sources"
LOW, ONE = f"{REUSE}/epsilon_low", f"{REUSE}/epsilon_1"
# The network of case 2 trained on case 2 alone, as the other sources are; with the low epsilon.
ALONE = f"{REUSE}/alone"
PARTS = (SOURCES, PAIRS, CONTROLS, LOW, ONE, ALONE)
# Cases whose networks are reused on the new case too: the paper's sources, and targets of its pairs.
OTHER_SOURCES, FURTHER_SOURCES = ("1", "3", "5"), ("4", "6")
LOW_EPSILON = 0.1
# Where the runs of an arm lie: part, pair (or another label), arm.
Place = tuple[str, str, str]


@dataclass(frozen=True)
class PlannedJob:
    """What every study.json says of a run.

    Jobs of one `stage` may run at once; a job's source comes from an earlier stage. `name` also names the
    file that starts the run alone.
    """

    name: str
    stage: int
    part: str
    label: str
    arm: str
    seed: int

    def folder(self, study: Path) -> Path:
        """Return the run's folder."""
        return run_folder(study, self.part, self.label, self.arm, self.seed)


@dataclass(frozen=True)
class Job(PlannedJob):
    """One run of a study; `values` are set in its configuration."""

    values: dict[str, Any]

    @property
    def has_trained_source(self) -> bool:
        """Whether the run begins with a network that was trained."""
        return Arm.parse(self.arm).has_trained_source


def run_folder(study: Path, part: str, label: str, arm: str, seed: int) -> Path:
    """Return the folder of a run in a study's folder."""
    return study / part / label / arm / f"seed={seed}"


def plan_jobs(config: StudyConfig) -> list[Job]:
    """Plan all runs of a study, in the order of their stages."""
    jobs = [job for seed in config.numbers for job in seed_jobs(config, seed)]
    return sorted(jobs, key=lambda job: (job.stage, job.seed))


def seed_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the runs of one seed: pairs, reuse, controls; each group after the sources that it needs."""
    groups = (pair_jobs, reuse_jobs, control_jobs, first_block_jobs)
    stage = 2 * len(groups) * block_of(config, seed)
    known: set[str] = set()
    for group in groups:
        runs = list(group(config, seed))
        needed = {str(run.values["source"]) for run in runs if run.has_trained_source}
        for case in sorted(needed - known):
            if source_place(config, case) == (SOURCES, case):
                yield replace(scratch_job(SOURCES, case, seed), stage=stage)
        for run in runs:
            is_source = (run.part, run.arm) == (PAIRS, SCRATCH) and str(run.values["target"]) in needed
            yield replace(run, stage=stage if is_source else stage + 1)
        known |= needed
        stage += 2


def block_of(config: StudyConfig, seed: int) -> int:
    """Return the number of a seed's block, from 0."""
    return (seed - config.first_seed) // config.block


def source_folder(run: Job, config: StudyConfig) -> Path | None:
    """Return the folder of the run that trains a run's source, below the study's folder; None without one."""
    if not run.has_trained_source:
        return None
    if "source_file" in run.values:
        return Path(run.values["source_file"]).parent.relative_to(config.folder.absolute())
    return Path(*source_place(config, str(run.values["source"])), SCRATCH, f"seed={run.seed}")


def pair_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan figures 5 to 7."""
    for pair in config.pairs:
        for arm in config.arms:
            yield transfer_job(PAIRS, pair, arm, seed)


def control_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the controls that run with all seeds."""
    return jobs_of_controls(config, seed, CONTROL_ARMS, CONTROL_PAIRS)


def first_block_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the controls that run with the first block of seeds only."""
    if block_of(config, seed) == 0:
        yield from jobs_of_controls(config, seed, FIRST_BLOCK_ARMS, FIRST_BLOCK_PAIRS)


def jobs_of_controls(
    config: StudyConfig, seed: int, arms: Sequence[str], pairs: Mapping[str, Sequence[str]]
) -> Iterator[Job]:
    """Plan arms on all pairs, and control pairs on targets for which the study has runs from scratch."""
    if not config.controls:
        return
    targets = {read_option("pair", pair)["target"] for pair in config.pairs}
    known = {pair: own for pair, own in pairs.items() if read_option("pair", pair)["target"] in targets}
    for pair, own in (*((pair, arms) for pair in config.pairs), *known.items()):
        for arm in own:
            yield transfer_job(CONTROLS, pair, arm, seed)


def source_place(config: StudyConfig, case: str) -> tuple[str, str]:
    """Return part and label of a case's run from scratch: that of a pair, if a pair has it anyway."""
    for pair in config.pairs if SCRATCH in config.arms else ():
        if str(read_option("pair", pair)["target"]) == case:
            return PAIRS, pair
    return SOURCES, case


def reuse_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the 2 x 2 of network (reused, scratch) and starting epsilon (low, 1), and the other sources."""
    if not config.reuse:
        return
    low: dict[str, Any] = {"learn": {"epsilon_start": LOW_EPSILON}}

    def policy(*place: str) -> str:
        return str(config.folder.absolute().joinpath(*place, f"seed={seed}", "policy.safetensors"))

    for part, extra in ((ONE, {}), (LOW, low)):
        yield scratch_job(part, NEW_CASE, seed, **extra)
        yield reuse_job(part, REUSED_CASE, seed, source_file=policy(PAIRS, REUSED_PAIR, REUSED_ARM), **extra)
    others = ((LOW, case) for case in OTHER_SOURCES + FURTHER_SOURCES)
    for part, case in ((ALONE, REUSED_CASE), *others):
        # A path, because a source that the run trained itself would have the low epsilon too.
        source = policy(*source_place(config, case), SCRATCH)
        yield reuse_job(part, case, seed, source_file=source, **low)


def make_job(part: str, label: str, arm: str, seed: int, values: dict[str, Any]) -> Job:
    """Make a job of stage 0."""
    name = "-".join((part.replace("/", "-"), label, arm, str(seed)))
    return Job(name, 0, part, label, arm, seed, values | {"seed": seed})


def scratch_job(part: str, case: str, seed: int, **extra: Any) -> Job:
    """Plan a case from scratch."""
    return make_job(part, case, SCRATCH, seed, {"target": case, **read_option("arm", SCRATCH), **extra})


def transfer_job(part: str, pair: str, arm: str, seed: int) -> Job:
    """Plan an arm of a pair."""
    return make_job(part, pair, arm, seed, {**read_option("pair", pair), **read_option("arm", arm)})


def reuse_job(part: str, source: str, seed: int, **extra: Any) -> Job:
    """Plan the whole network of another case on the new case."""
    values = {"source": source, "target": NEW_CASE, **read_option("arm", WHOLE), **extra}
    return make_job(part, reuse_label(source), WHOLE, seed, values)


def reuse_label(source: str) -> str:
    """Return the label of a case's network on the new case."""
    return f"{source}-{NEW_CASE}"


def scratch_place(part: str, label: str) -> Place:
    """Return the place of the runs from scratch that the runs of a label are compared with."""
    if part in (LOW, ONE, ALONE):
        return (ONE if part == ONE else LOW), NEW_CASE, SCRATCH
    if part == CONTROLS:
        return PAIRS, SCRATCH_PAIR.get(label, label), SCRATCH
    return (SOURCES if part == SOURCES else PAIRS), label, SCRATCH
