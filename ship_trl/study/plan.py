"""Which runs a study consists of, and in what order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ship_trl.study.config import (
    NEW_CASE,
    RANDOM_ARM,
    REUSED_ARM,
    REUSED_CASE,
    REUSED_PAIR,
    SELF_PAIR,
    StudyConfig,
    read,
)

# Parts of a study, which are its folders: the paper's figures 5 to 7, figure 9, and our controls.
PAIRS, REUSE, CONTROLS, SOURCES = "pairs", "reuse", "controls", "sources"
LOW, ONE = f"{REUSE}/epsilon_low", f"{REUSE}/epsilon_1"
# The low epsilon too; case 2's network here was trained on case 2 alone, as those of other sources were.
ALONE = f"{REUSE}/alone"
PARTS = (SOURCES, PAIRS, CONTROLS, LOW, ONE, ALONE)
OTHER_SOURCES = ("1", "3", "5")
LOW_EPSILON = 0.1
SELF_CASE = "2"
SELF_ARMS = ("FE1", "FE2", "FE3", "FE4", "FT1", "FT2", "FT3", "FT4")


@dataclass(frozen=True)
class Job:
    """One run of a study.

    `stage` orders what depends on one another: all of a stage may run at once. `values` are set in
    the run's configuration, `groups` are chosen in it.
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
        return study / self.part / self.label / self.arm / f"seed={self.seed}"


def plan_jobs(config: StudyConfig) -> list[Job]:
    """All runs of a study, in the order of their stages."""
    jobs = [job for seed in config.numbers for job in of_seed(config, seed)]
    return sorted(jobs, key=lambda job: (job.stage, job.seed))


def sources_of(config: StudyConfig) -> set[str]:
    """Cases whose networks others begin with."""
    needed = {str(read("pair", pair)["source"]) for pair in config.pairs}
    if config.reuse:
        needed |= {REUSED_CASE, *OTHER_SOURCES}
    return needed | {SELF_CASE} if config.controls else needed


def of_seed(config: StudyConfig, seed: int) -> Iterator[Job]:
    """The runs of one seed."""
    sources = sources_of(config)
    for case in sorted(sources):
        if trained_alone(config, case) == (SOURCES, case):
            yield alone(SOURCES, case, seed, stage=0)
    for pair in config.pairs:
        for arm in config.arms:
            serves = arm == "scratch" and str(read("pair", pair)["target"]) in sources
            yield transfer(PAIRS, pair, arm, seed, stage=0 if serves else 1)
        if config.controls:
            yield transfer(CONTROLS, pair, RANDOM_ARM, seed, stage=1)
    if config.controls:
        for arm in SELF_ARMS:
            yield transfer(CONTROLS, SELF_PAIR, arm, seed, stage=1)
    if config.reuse:
        yield from reuse_jobs(config, seed)


def trained_alone(config: StudyConfig, case: str) -> tuple[str, str]:
    """Part and label of a case's run from scratch: a pair's that has it anyway, so that none is run twice."""
    for pair in config.pairs if "scratch" in config.arms else ():
        if str(read("pair", pair)["target"]) == case:
            return PAIRS, pair
    return SOURCES, case


def reuse_jobs(config: StudyConfig, seed: int) -> Iterator[Job]:
    """Network (reused, from scratch) by starting epsilon (low, 1); at the low one, sources trained alike."""
    low: dict[str, Any] = {"learn": {"epsilon_start": LOW_EPSILON}}

    def policy(*place: str) -> str:
        return str(config.folder.absolute().joinpath(*place, f"seed={seed}", "policy.safetensors"))

    for part, extra in ((ONE, {}), (LOW, low)):
        yield alone(part, NEW_CASE, seed, 1, **extra)
        yield whole(part, REUSED_CASE, seed, 2, source_file=policy(PAIRS, REUSED_PAIR, REUSED_ARM), **extra)
    for part, case in ((ALONE, REUSED_CASE), *((LOW, other) for other in OTHER_SOURCES)):
        # By file, because a source of its own would be trained with the low epsilon too.
        source = policy(*trained_alone(config, case), "scratch")
        yield whole(part, case, seed, 1, source_file=source, **low)


def job(stage: int, part: str, label: str, arm: str, seed: int, values: dict[str, Any]) -> Job:
    """A run; its name is also that of the file from which it can be started alone."""
    name = "-".join((part.replace("/", "-"), label, arm, str(seed)))
    return Job(name, stage, part, label, arm, seed, values | {"seed": seed})


def alone(part: str, case: str, seed: int, stage: int, **extra: Any) -> Job:
    """A case from scratch."""
    return job(stage, part, case, "scratch", seed, {"target": case, **read("arm", "scratch"), **extra})


def transfer(part: str, pair: str, arm: str, seed: int, stage: int) -> Job:
    """An arm on a pair."""
    return job(stage, part, pair, arm, seed, {**read("pair", pair), **read("arm", arm)})


def whole(part: str, source: str, seed: int, stage: int, **extra: Any) -> Job:
    """The whole network of another case on the new one."""
    cases = {"source": source, "target": NEW_CASE}
    return job(stage, part, f"{source}-{NEW_CASE}", "FTW", seed, {**cases, **read("arm", "FTW"), **extra})


def from_scratch(part: str, label: str) -> tuple[str, str, str]:
    """Part, label and arm of the runs from scratch that those of a label are compared with."""
    if part in (LOW, ONE, ALONE):
        return (ONE if part == ONE else LOW), NEW_CASE, "scratch"
    if (part, label) == (CONTROLS, SELF_PAIR):
        return PAIRS, REUSED_PAIR, "scratch"
    return (SOURCES if part == SOURCES else PAIRS), label, "scratch"
