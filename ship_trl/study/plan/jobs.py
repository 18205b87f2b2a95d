"""Which runs a study consists of, and in what order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ship_trl.study.plan.config import (
    CONTROL_ARMS,
    CONTROL_PAIRS,
    EXPLORING_ARMS,
    EXPLORING_PAIRS,
    NEW_CASE,
    REUSED_ARM,
    REUSED_CASE,
    REUSED_PAIR,
    StudyConfig,
    read,
)

# Parts of a study, which are its folders: the paper's figures 5 to 7, figure 9, and our controls.
PAIRS, REUSE, CONTROLS, SOURCES = "pairs", "reuse", "controls", "sources"
LOW, ONE = f"{REUSE}/epsilon_low", f"{REUSE}/epsilon_1"
# The low epsilon too; case 2's network here was trained on case 2 alone, as those of other sources were.
ALONE = f"{REUSE}/alone"
PARTS = (SOURCES, PAIRS, CONTROLS, LOW, ONE, ALONE)
# Sources of the paper's pairs, and targets of them.
OTHER_SOURCES, FURTHER_SOURCES = ("1", "3", "5"), ("4", "6")
LOW_EPSILON = 0.1
# The pair whose runs from scratch are those of a control's target.
COMPARED = {"self": "high", "ship": "high", "self4": "low", "self6": "lowest"}


@dataclass(frozen=True)
class Job:
    """One run of a study.

    `stage` orders blocks of seeds, what is run first in a block, and what depends on one another: all
    of a stage may run at once. `values` are set in the run's configuration.
    """

    name: str
    stage: int
    part: str
    label: str
    arm: str
    seed: int
    values: dict[str, Any]

    def folder(self, study: Path) -> Path:
        """Where its results lie."""
        return run_folder(study, self.part, self.label, self.arm, self.seed)


def run_folder(study: Path, part: str, label: str, arm: str, seed: int) -> Path:
    """Where a study keeps a run's results."""
    return study / part / label / arm / f"seed={seed}"


def plan_jobs(config: StudyConfig) -> list[Job]:
    """All runs of a study, in the order of their stages."""
    jobs = [job for seed in config.numbers for job in of_seed(config, seed)]
    return sorted(jobs, key=lambda job: (job.stage, job.seed))


def of_seed(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the runs of one seed: figures 5 to 7, reuse, controls, each behind the sources that it needs."""
    groups = (pair_jobs, reuse_jobs, control_jobs, exploring_jobs)
    stage = 2 * len(groups) * block_of(config, seed)
    known: set[str] = set()
    for group in groups:
        runs = list(group(config, seed))
        needed = {str(run.values["source"]) for run in runs if needs_source(run)}
        for case in sorted(needed - known):
            if trained_alone(config, case) == (SOURCES, case):
                yield replace(alone(SOURCES, case, seed), stage=stage)
        for run in runs:
            serves = (run.part, run.arm) == (PAIRS, "scratch") and str(run.values["target"]) in needed
            yield replace(run, stage=stage if serves else stage + 1)
        known |= needed
        stage += 2


def block_of(config: StudyConfig, seed: int) -> int:
    """Count the block of a seed, from 0."""
    return (seed - config.first_seed) // config.block


def needs_source(run: Job) -> bool:
    """Whether a run begins with a network that was trained."""
    return run.arm != "scratch" and run.values.get("source_weights") != "random"


def source_of(run: Job, config: StudyConfig) -> Path | None:
    """Where in the study's folder the run lies with whose network this one begins; None if with none."""
    if not needs_source(run):
        return None
    if "source_file" in run.values:
        return Path(run.values["source_file"]).parent.relative_to(config.folder.absolute())
    return Path(*trained_alone(config, str(run.values["source"])), "scratch", f"seed={run.seed}")


def pair_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Figures 5 to 7."""
    for pair in config.pairs:
        for arm in config.arms:
            yield transfer(PAIRS, pair, arm, seed)


def control_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the controls that are run with all seeds."""
    return controls(config, seed, CONTROL_ARMS, CONTROL_PAIRS)


def exploring_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Plan the controls that are run with the first block of seeds only."""
    if block_of(config, seed) > 0:
        return iter(())
    return controls(config, seed, EXPLORING_ARMS, EXPLORING_PAIRS)


def controls(
    config: StudyConfig, seed: int, arms: Sequence[str], pairs: Mapping[str, Sequence[str]]
) -> Iterator[Job]:
    """Arms on all pairs, and pairs on targets that the study has, for there they can be compared."""
    if not config.controls:
        return
    for pair in config.pairs:
        for arm in arms:
            yield transfer(CONTROLS, pair, arm, seed)
    targets = {read("pair", pair)["target"] for pair in config.pairs}
    for pair, own in pairs.items():
        if read("pair", pair)["target"] in targets:
            for arm in own:
                yield transfer(CONTROLS, pair, arm, seed)


def trained_alone(config: StudyConfig, case: str) -> tuple[str, str]:
    """Part and label of a case's run from scratch: a pair's that has it anyway, so that none is run twice."""
    for pair in config.pairs if "scratch" in config.arms else ():
        if str(read("pair", pair)["target"]) == case:
            return PAIRS, pair
    return SOURCES, case


def reuse_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Network (reused, from scratch) by starting epsilon (low, 1); at the low one, sources trained alike."""
    if not config.reuse:
        return
    low: dict[str, Any] = {"learn": {"epsilon_start": LOW_EPSILON}}

    def policy(*place: str) -> str:
        return str(config.folder.absolute().joinpath(*place, f"seed={seed}", "policy.safetensors"))

    for part, extra in ((ONE, {}), (LOW, low)):
        yield alone(part, NEW_CASE, seed, **extra)
        yield whole(part, REUSED_CASE, seed, source_file=policy(PAIRS, REUSED_PAIR, REUSED_ARM), **extra)
    others = ((LOW, case) for case in OTHER_SOURCES + FURTHER_SOURCES)
    for part, case in ((ALONE, REUSED_CASE), *others):
        # By file, because a source of its own would be trained with the low epsilon too.
        source = policy(*trained_alone(config, case), "scratch")
        yield whole(part, case, seed, source_file=source, **low)


def job(part: str, label: str, arm: str, seed: int, values: dict[str, Any]) -> Job:
    """Plan a run, not yet in its stage; its name is also that of the file that starts it alone."""
    name = "-".join((part.replace("/", "-"), label, arm, str(seed)))
    return Job(name, 0, part, label, arm, seed, values | {"seed": seed})


def alone(part: str, case: str, seed: int, **extra: Any) -> Job:
    """Plan a case from scratch."""
    return job(part, case, "scratch", seed, {"target": case, **read("arm", "scratch"), **extra})


def transfer(part: str, pair: str, arm: str, seed: int) -> Job:
    """Plan an arm on a pair."""
    return job(part, pair, arm, seed, {**read("pair", pair), **read("arm", arm)})


def whole(part: str, source: str, seed: int, **extra: Any) -> Job:
    """Plan the whole network of another case on the new one."""
    cases = {"source": source, "target": NEW_CASE}
    return job(part, f"{source}-{NEW_CASE}", "FTW", seed, {**cases, **read("arm", "FTW"), **extra})


def from_scratch(part: str, label: str) -> tuple[str, str, str]:
    """Part, label and arm of the runs from scratch that those of a label are compared with."""
    if part in (LOW, ONE, ALONE):
        return (ONE if part == ONE else LOW), NEW_CASE, "scratch"
    if part == CONTROLS:
        return PAIRS, COMPARED.get(label, label), "scratch"
    return (SOURCES if part == SOURCES else PAIRS), label, "scratch"
