"""Which runs the study of sources has: sources, baselines, and transfers of each case to every other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ship_trl.config.arm import SCRATCH
from studies.lockstep import Task

FOLDER = Path("outputs/sources")
# Target and source of runs; no source from scratch.
Pairs = Sequence[tuple[str, str]]
PAPER = ("1", "2", "3", "4", "5", "6", "new")
IMAZU = tuple(f"imazu{number:02}" for number in range(1, 23))


@dataclass(frozen=True)
class Setting:
    """What is trained: cases, arms, and how long in environment steps; `scratch_seeds` of the baselines."""

    overrides: tuple[str, ...]
    cases: tuple[str, ...]
    arms: tuple[str, ...]
    source_length: int
    target_length: int
    seeds: int
    scratch_seeds: int = 10


SETTINGS = {
    # Small, so that all runs of a target are trained at once, in seconds of a core each.
    "numbers": Setting(
        (
            *("observation=vector", "algorithm=n_step", "network.linear=[64,64,128,128]"),
            *("learn.num_envs=32", "learn.batch_size=64", "learn.update_every=16"),
            *("learn.lr=1e-3", "learn.warmup_steps=500"),
        ),
        PAPER + IMAZU,
        ("FE2", "FTW", "FTH"),
        source_length=48_000,
        target_length=12_000,
        seeds=3,
    ),
    # Profile quick. The Imazu problems with one, two and three ships whose best known return is lowest.
    "pixels": Setting(
        ("observation=pixels",),
        (*PAPER, "imazu03", "imazu07", "imazu17"),
        ("FE3", "FTW", "FTH"),
        source_length=24_000,
        target_length=12_000,
        seeds=2,
    ),
}


def plan_tasks(setting: Setting) -> list[Task]:
    """List all runs: sources, baselines, then transfers, a seed after the other."""

    def runs(pairs: Pairs, arms: Sequence[str], seeds: int, length: int, *, are_sources: bool) -> list[Task]:
        return [
            Task(*pair, arm, seed, length, is_source=are_sources)
            for seed in range(seeds)
            for pair in pairs
            for arm in arms
        ]

    cases, length, scratch = setting.cases, setting.target_length, (SCRATCH.name,)
    alone = [(case, "") for case in cases]
    pairs = [(target, source) for target in cases for source in cases if source != target]
    return [
        *runs(alone, scratch, setting.seeds, setting.source_length, are_sources=True),
        *runs(alone, scratch, setting.scratch_seeds, length, are_sources=False),
        *runs(pairs, setting.arms, setting.seeds, length, are_sources=False),
    ]
