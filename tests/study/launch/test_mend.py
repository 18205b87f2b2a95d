"""What is damaged is set aside under another name; what is whole, or was only stopped, stays."""

from pathlib import Path

import numpy as np
import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.study.launch.mend import set_aside
from ship_trl.study.plan.config import StudyConfig, to_study
from ship_trl.study.plan.jobs import PAIRS, Job, plan_jobs
from tests.command import files
from tests.study.commands import SMALL
from tests.study.synthetic import learning, write_run


def a_study(folder: Path) -> tuple[StudyConfig, list[Job]]:
    """Finished runs of `scratch` and FTW, two seeds each."""
    config = to_study([*SMALL, f"output={folder}"])
    jobs = [job for job in plan_jobs(config) if job.part == PAIRS]
    for job in jobs:
        scores = learning(np.random.default_rng(job.seed), 50)
        write_run(folder / PAIRS, scores, pair=job.label, arm=job.arm, seed=job.seed)
    assert len(jobs) == 4
    return config, jobs


def test_whole_and_stopped_runs_stay(tmp_path: Path) -> None:
    config, jobs = a_study(tmp_path)
    (jobs[0].folder(tmp_path) / "result.json").unlink()
    (jobs[0].folder(tmp_path) / "curve.csv").write_text("episode\n")
    before = files(tmp_path)
    assert list(set_aside(jobs, config)) == [] and files(tmp_path) == before


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("curve.csv", "episode,return\n1,", "curve.csv cannot be read"),
        ("result.json", '{"pair": "hi', "result.json cannot be read"),
        ("result.json", "{}", "result.json has schema_version None; only 3 can be read"),
    ],
)
def test_a_damaged_run_is_renamed_with_all_that_it_holds(
    tmp_path: Path, name: str, text: str, said: str
) -> None:
    config, jobs = a_study(tmp_path)
    place = jobs[1].folder(tmp_path)
    (place / name).write_text(text)
    held = files(place)
    (line,) = set_aside(jobs, config)
    assert line == f"{place}: {said}; kept as damaged-1-{place.name} and trained again"
    assert not place.exists() and files(place.with_name(f"damaged-1-{place.name}")) == held
    # A second time, because the disk is failing.
    place.mkdir()
    (place / "result.json").write_text("")
    (line,) = set_aside(jobs, config)
    assert f"damaged-2-{place.name}" in line and files(place.with_name(f"damaged-1-{place.name}")) == held


def test_a_copied_run_is_of_another_place(tmp_path: Path) -> None:
    config, jobs = a_study(tmp_path)
    one, other = jobs[0].folder(tmp_path), jobs[1].folder(tmp_path)
    (one / "result.json").write_bytes((other / "result.json").read_bytes())
    (line,) = set_aside(jobs, config)
    assert "result.json is of another run" in line


def test_a_folder_that_cannot_be_renamed_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config, jobs = a_study(tmp_path)
    (jobs[0].folder(tmp_path) / "curve.csv").unlink()

    def refuse(self: Path, target: Path) -> Path:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "rename", refuse)
    with pytest.raises(ConfigError, match=r"output: .* cannot be set aside: Permission denied"):
        list(set_aside(jobs, config))
