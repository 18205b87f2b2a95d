"""Which runs the study of sources has: sources, baselines, and transfers of each case to every other."""

from __future__ import annotations

from pathlib import Path

from ship_trl.config.arm import SCRATCH
from studies.runs import Setting, Task

FOLDER = Path("outputs/sources")
PAPER = ("1", "2", "3", "4", "5", "6", "new")
IMAZU = tuple(f"imazu{number:02}" for number in range(1, 23))
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
    cases, seeds = setting.cases, range(setting.seeds)
    tasks = [Task(case, "", SCRATCH.name, seed, True) for seed in seeds for case in cases]
    tasks += [Task(case, "", SCRATCH.name, seed) for seed in range(setting.scratch_seeds) for case in cases]
    pairs = [(source, target) for target in cases for source in cases if source != target]
    return tasks + [
        Task(target, source, arm, seed) for seed in seeds for source, target in pairs for arm in setting.arms
    ]
