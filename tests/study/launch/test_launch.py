"""Runs without a result are started again; damaged runs are renamed, and whole or stopped ones stay."""

import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ship_trl.study import launch
from ship_trl.study.plan import PAIRS, Job, StudyConfig, plan_jobs, to_study
from tests.a_result import a_result
from tests.command import files
from tests.pasted import ODD, composed_values
from tests.study.commands import SMALL
from tests.study.synthetic import learning, write_run

# Ends the first of its runs and dies, as a launcher does with a worker of which it hears no more.
ONE = """
import pathlib, sys
path = pathlib.Path(sys.argv[1])
path.parent.mkdir(parents=True)
path.write_text(sys.argv[2])
"""


def rounds(monkeypatch: pytest.MonkeyPatch, fails: str) -> list[list[str]]:
    """What the launcher is given, round by round; runs of the arm `fails` never end with a result."""
    given = []

    def command(jobs: list[Job], config: StudyConfig) -> list[str]:
        given.append([job.name for job in jobs])
        able = [job for job in jobs if job.arm != fails]
        if not able:
            return [sys.executable, "-c", "raise SystemExit(1)"]
        result = json.dumps(a_result(arm=able[0].arm, seed=able[0].seed).to_json())
        return [sys.executable, "-c", ONE, str(able[0].folder(config.folder) / "result.json"), result]

    monkeypatch.setattr(launch, "command", command)
    return given


def run(folder: Path, retries: int) -> list[Job]:
    config = to_study([*SMALL, f"output={folder}", f"retries={retries}"])
    return launch.run_jobs(plan_jobs(config), config, lambda: None)


@pytest.mark.parametrize("name", ODD)
def test_hydra_gets_the_folder_that_was_asked_for(name: str, tmp_path: Path) -> None:
    config = replace(to_study([*SMALL, "logger=wandb"]), output=str(tmp_path / name))
    words = launch.command(plan_jobs(config), config)[6:]
    given = composed_values(shlex.join(["python", "-m", "ship_trl", *words]))
    assert given["hydra.sweep.dir"] == str(tmp_path / name)


def test_a_round_that_ends_a_run_is_no_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = rounds(monkeypatch, fails="none")
    assert run(tmp_path, retries=0) == []
    assert list(map(len, given)) == [2, 1, 4, 3, 2, 1]


def test_rounds_that_end_no_run_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = rounds(monkeypatch, fails="FTW")
    left = run(tmp_path, retries=1)
    assert [job.name for job in left] == ["pairs-high-FTW-0", "pairs-high-FTW-1"]
    assert list(map(len, given)) == [2, 1, 4, 3, 2, 2]


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
    assert list(launch.set_aside(jobs, config)) == [] and files(tmp_path) == before


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
    (line,) = launch.set_aside(jobs, config)
    assert line == f"{place}: {said}; kept as damaged-1-{place.name} and trained again"
    assert not place.exists() and files(place.with_name(f"damaged-1-{place.name}")) == held
    # A second time, because the disk is failing.
    place.mkdir()
    (place / "result.json").write_text("")
    (line,) = launch.set_aside(jobs, config)
    assert f"damaged-2-{place.name}" in line and files(place.with_name(f"damaged-1-{place.name}")) == held


def test_a_copied_run_is_of_another_place(tmp_path: Path) -> None:
    config, jobs = a_study(tmp_path)
    one, other = jobs[0].folder(tmp_path), jobs[1].folder(tmp_path)
    (one / "result.json").write_bytes((other / "result.json").read_bytes())
    (line,) = launch.set_aside(jobs, config)
    assert "result.json is of another run" in line


# Takes a while to end when it is asked to, as a run that writes its checkpoint.
SLOW = """
import pathlib, signal, sys, time

def end(*_):
    time.sleep(0.6)
    pathlib.Path(sys.argv[1], "ended").touch()
    sys.exit()

signal.signal(signal.SIGTERM, end)
pathlib.Path(sys.argv[1], "begun").touch()
time.sleep(60)
"""


def test_an_interrupted_study_waits_for_its_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = to_study([*SMALL, f"output={tmp_path}"])
    monkeypatch.setattr(launch, "command", lambda *_: [sys.executable, "-c", SLOW, str(tmp_path)])

    def interrupt() -> None:
        if (tmp_path / "begun").exists():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        launch.run_jobs(plan_jobs(config), config, interrupt)
    assert (tmp_path / "ended").exists()
