"""Which runs the second study has, by question; README.md has the questions and rules."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ship_trl.config.arm import SCRATCH
from studies.lockstep import Task
from studies.sources.plan import IMAZU, SETTINGS

FOLDER = Path("outputs/questions")
# Source and target of each pair, the least similar last.
PAIRS = {"high": ("1", "2"), "low": ("3", "4"), "lowest": ("5", "6")}
# Question 1; FE4 from the pair's source, and from the target itself, is question 2.
ARMS, FROZEN = ("FT4", "FTW", "FTH", "FE3", "FE3-random"), "FE4"
# Question 3. The sources have learned random encounters.
TRAFFIC, TRAFFIC_SEEDS, TRAFFIC_ARMS = "traffic", 5, ("FE3", "FTW", "FTH")
# Question 6: other settings of the learner.
LEARNERS = tuple(
    f"learn.lr={lr} learn.epsilon_start={epsilon}"
    for lr in ("5e-4", "1e-3", "2e-3")
    for epsilon in ("1", "0.3")
    if (lr, epsilon) != ("1e-3", "1")
)
TUNED_ARMS = ("FTW", "FE3")
# Seeds that nothing was chosen on; sources have others than the runs that use them.
FIRST_SEED, FIRST_SOURCE = 1000, 2000


@dataclass(frozen=True)
class Sizes:
    """How many runs a target, an arm, or a problem of question 3 has."""

    scratch: int = 45
    arm: int = 30
    problem: int = 20
    tuned: int = 30


SIZES = {"numbers": Sizes(), "pixels": Sizes(scratch=30, arm=20, problem=0, tuned=0)}


def plan_tasks(name: str) -> list[Task]:
    """List all runs of a setting, sources first."""
    setting, sizes = SETTINGS[name], SIZES[name]

    def scratch(target: str, count: int, learner: str = "") -> Iterator[Task]:
        for k in range(count):
            yield Task(target, "", SCRATCH.name, FIRST_SEED + k, setting.target_length, learner)

    def transfers(
        target: str, source: str, arms: tuple[str, ...], count: int, sources: int = 0, learner: str = ""
    ) -> Iterator[Task]:
        """Yield transfers; run k has source k, or source k modulo their number."""
        for arm in arms:
            for k in range(count):
                source_seed = FIRST_SOURCE + k % (sources or count)
                task = target, source, arm, FIRST_SEED + k, setting.target_length
                yield Task(*task, learner, source_seed)

    tasks = [
        Task(case, "", SCRATCH.name, FIRST_SOURCE + k, setting.source_length, is_source=True)
        for k in range(sizes.arm)
        for case in dict.fromkeys(case for pair in PAIRS.values() for case in pair)
    ]
    for source, target in PAIRS.values():
        tasks += scratch(target, sizes.scratch)
        tasks += transfers(target, source, (*ARMS, FROZEN), sizes.arm)
        tasks += transfers(target, target, (FROZEN,), sizes.arm)
    for target in IMAZU if sizes.problem else ():
        tasks += scratch(target, sizes.problem)
        tasks += transfers(target, TRAFFIC, TRAFFIC_ARMS, sizes.problem, TRAFFIC_SEEDS)
    for learner in LEARNERS if sizes.tuned else ():
        for source, target in PAIRS.values():
            tasks += scratch(target, sizes.tuned, learner)
            tasks += transfers(target, source, TUNED_ARMS, sizes.tuned, learner=learner)
    return tasks
