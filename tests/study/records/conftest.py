"""A small study and its copy, for all tests of copies."""

from pathlib import Path

import numpy as np
import pytest

from ship_trl.study.manifest import write_plan
from ship_trl.study.plan import plan_jobs, to_study
from tests.command import keep
from tests.study.commands import SMALL
from tests.study.synthetic import learning, write_run


def a_study(folder: Path, seeds: int = 3) -> Path:
    """All runs of a small study, with draws but for those of seed 1."""
    config = to_study([*SMALL, f"output={folder}", f"seeds={seeds}"])
    jobs = plan_jobs(config)
    write_plan(jobs, config)
    for k, job in enumerate(jobs):
        rng = np.random.default_rng(k)
        network = f"/home/somebody/study/case_base/1/scratch/seed={job.seed}-abc/policy.safetensors"
        changes = {"draws": rng.normal(-300, 50, 4).tolist()} if job.seed != 1 else {}
        write_run(
            folder / job.part,
            learning(rng, 50),
            pair=job.label,
            arm=job.arm,
            seed=job.seed,
            source_network=network if job.arm == "FTW" else None,
            seconds=61.5,
            **changes,
        )
    return folder


@pytest.fixture
def whole_study(tmp_path: Path) -> Path:
    return a_study(tmp_path / "study")


@pytest.fixture
def copy(whole_study: Path, tmp_path: Path) -> Path:
    keep([str(whole_study), str(tmp_path / "copy")])
    return tmp_path / "copy"
