"""The runs of a study and their order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
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

# The parts of a study, which are its folders: figures 5 to 7, figure 9, our controls, and further sources.
PAIRS, REUSE, CONTROLS, SOURCES = "pairs", "reuse", "controls", "sources"
LOW, ONE = f"{REUSE}/epsilon_low", f"{REUSE}/epsilon_1"
# Case 2's network trained on case 2 alone, as the other sources are; reused with the low epsilon.
ALONE = f"{REUSE}/alone"
PARTS = (SOURCES, PAIRS, CONTROLS, LOW, ONE, ALONE)
# Cases whose networks are reused on the new case too: the paper's sources, and targets of its pairs.
OTHER_SOURCES, FURTHER_SOURCES = ("1", "3", "5"), ("4", "6")
LOW_EPSILON = 0.1
# An arm's place in a study: part, pair (or another label), arm.
Place = tuple[str, str, str]


@dataclass(frozen=True)
class Job:
    """A run of a study.

    Jobs of one `stage` may run in parallel; a job's source comes from an earlier stage. `name` is also the
    name of the file that starts the run alone. `values` are set in the run's configuration; a study that was
    kept as tables has none.
    """

    name: str
    stage: int
    part: str
    label: str
    arm: str
    seed: int
    values: dict[str, Any] = field(default_factory=dict)

    @property
    def has_trained_source(self) -> bool:
        """Whether the run starts with layers of a trained network."""
        return Arm.parse(self.arm).has_trained_source

    def folder(self, study: Path) -> Path:
        """Return the run's folder."""
        return run_folder(study, self.part, self.label, self.arm, self.seed)


def run_folder(study: Path, part: str, label: str, arm: str, seed: int) -> Path:
    """Return the folder of a run in a study's folder."""
    return study / part / label / arm / f"seed={seed}"


def plan_jobs(config: StudyConfig) -> list[Job]:
    """Plan all runs of a study, in the order of their stages."""
    jobs = [job for seed in config.numbers for job in seed_jobs(config, seed)]
    return sorted(jobs, key=lambda job: (job.stage, job.seed))


def seed_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the runs of one seed: pairs, reuse, controls; each group after the sources that it needs."""
    block = (seed - config.first_seed) // config.block
    groups = (
        [
            make_job(PAIRS, pair, arm, seed, read_option("pair", pair))
            for pair in config.pairs
            for arm in config.arms
        ],
        list(reuse_jobs(config, seed)),
        list(control_jobs(config, seed, CONTROL_ARMS, CONTROL_PAIRS)),
        list(control_jobs(config, seed, FIRST_BLOCK_ARMS, FIRST_BLOCK_PAIRS)) if block == 0 else [],
    )
    stage = 2 * len(groups) * block
    known: set[str] = set()
    for group in groups:
        needed = {str(job.values["source"]) for job in group if job.has_trained_source}
        for case in sorted(needed - known):
            if source_place(config, case) == (SOURCES, case):
                yield replace(make_job(SOURCES, case, SCRATCH, seed, {"target": case}), stage=stage)
        for job in group:
            is_source = (job.part, job.arm) == (PAIRS, SCRATCH) and str(job.values["target"]) in needed
            yield replace(job, stage=stage if is_source else stage + 1)
        known |= needed
        stage += 2


def make_job(part: str, label: str, arm: str, seed: int, cases: Mapping[str, Any], **extra: Any) -> Job:
    """Make a job of stage 0 with source and target, and with further values of its configuration."""
    name = "-".join((part.replace("/", "-"), label, arm, str(seed)))
    values = {**cases, **read_option("arm", arm), **extra, "seed": seed}
    return Job(name, 0, part, label, arm, seed, values)


def reuse_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the 2 x 2 of network (reused, scratch) and starting epsilon (low, 1), and the other sources."""
    if not config.reuse:
        return

    def reuse(part: str, case: str, *place: str, **extra: Any) -> Job:
        # A path, because a source that the run trained itself would have the low epsilon too.
        folder = config.folder.absolute().joinpath(*place, f"seed={seed}")
        cases = {"source": case, "target": NEW_CASE}
        source_file = str(folder / "policy.safetensors")
        return make_job(part, reuse_label(case), WHOLE, seed, cases, source_file=source_file, **extra)

    low = {"learn": {"epsilon_start": LOW_EPSILON}}
    for part, extra in ((ONE, {}), (LOW, low)):
        yield make_job(part, NEW_CASE, SCRATCH, seed, {"target": NEW_CASE}, **extra)
        yield reuse(part, REUSED_CASE, PAIRS, REUSED_PAIR, REUSED_ARM, **extra)
    yield reuse(ALONE, REUSED_CASE, *source_place(config, REUSED_CASE), SCRATCH, **low)
    for case in OTHER_SOURCES + FURTHER_SOURCES:
        yield reuse(LOW, case, *source_place(config, case), SCRATCH, **low)


def control_jobs(
    config: StudyConfig, seed: int, arms: Sequence[str], pairs: Mapping[str, Sequence[str]]
) -> Iterator[Job]:
    """Plan control arms on all pairs, and control pairs whose target has runs from scratch in the study."""
    if not config.controls:
        return
    targets = {read_option("pair", pair)["target"] for pair in config.pairs}
    known = {pair: own for pair, own in pairs.items() if read_option("pair", pair)["target"] in targets}
    for pair, own in (*((pair, arms) for pair in config.pairs), *known.items()):
        for arm in own:
            yield make_job(CONTROLS, pair, arm, seed, read_option("pair", pair))


def source_place(config: StudyConfig, case: str) -> tuple[str, str]:
    """Return part and label of a case's run from scratch: those of a pair, if one has this target."""
    for pair in config.pairs if SCRATCH in config.arms else ():
        if str(read_option("pair", pair)["target"]) == case:
            return PAIRS, pair
    return SOURCES, case


def source_folder(job: Job, config: StudyConfig) -> Path | None:
    """Return the folder of the run that trains a job's source, relative to the study's; None without one."""
    if not job.has_trained_source:
        return None
    if "source_file" in job.values:
        return Path(job.values["source_file"]).parent.relative_to(config.folder.absolute())
    return Path(*source_place(config, str(job.values["source"])), SCRATCH, f"seed={job.seed}")


def reuse_label(source: str) -> str:
    """Return the label of a case's network on the new case."""
    return f"{source}-{NEW_CASE}"


def scratch_place(part: str, label: str) -> Place:
    """Return the place of the runs from scratch that a label's runs are compared with."""
    if part in (LOW, ONE, ALONE):
        return (ONE if part == ONE else LOW), NEW_CASE, SCRATCH
    if part == CONTROLS:
        return PAIRS, SCRATCH_PAIR.get(label, label), SCRATCH
    return (SOURCES if part == SOURCES else PAIRS), label, SCRATCH
