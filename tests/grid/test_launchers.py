"""Slurm's launcher and Ray's: the same study, and a worker that is killed costs a run a retry."""

import os
import re
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ship_trl.grid.callback import close_token
from ship_trl.grid.launchers import JOBLIB
from tests.command import environment, files, ship_trl
from tests.study.commands import SMALL, descendants, learned, study


@pytest.mark.long
def test_a_study_is_the_same_by_submitit(whole: Path, tmp_path: Path) -> None:
    # A name that Hydra's grammar would not take unquoted.
    place = tmp_path / "a study, (its) folder=here's"
    place.mkdir()
    study(*SMALL, "launcher=slurm_local", folder=place)
    assert learned(place) == learned(whole)


@pytest.mark.parametrize(("name", "code"), [(f"{JOBLIB}-1", -signal.SIGTERM), ("MainProcess", 0)])
def test_a_process_whose_launcher_is_gone_before_it_begins_ends(name: str, code: int) -> None:
    program = (
        "from multiprocessing import current_process\n"
        "from ship_trl.grid.launchers import die_with_launcher\n"
        f"current_process().name = {name!r}\n"
        "die_with_launcher()\n"
    )
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    line = environment() | {"SHIP_TRL_LAUNCHER": str(gone.pid)}
    assert subprocess.run([sys.executable, "-c", program], env=line, check=False).returncode == code


@pytest.mark.long
def test_no_run_outlives_a_killed_grid(tmp_path: Path) -> None:
    grid = ("target=1", "method=scratch", "profile=smoke", "learn.episodes=2000", "seed=0,1")
    # By itself it would run one after the other, and in no process of its own, where there is one core.
    line = [sys.executable, "-m", "ship_trl", "-m", "hydra.launcher.n_jobs=2", *grid]
    child = subprocess.Popen(line, cwd=tmp_path, env=environment(), stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 300
    try:
        while len(list(tmp_path.rglob("curve.csv"))) < 2:
            assert time.monotonic() < deadline and child.poll() is None
            time.sleep(0.1)
        family = descendants(child.pid)
    finally:
        child.kill()
        child.wait()
    assert len(family) >= 2
    while any(Path(f"/proc/{process}").exists() for process in family):
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.mark.long
def test_rays_token_is_in_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    grid = ("target=1", "method=scratch", "profile=smoke", "seed=0,1")
    # Ray reads its settings of the environment once a process.
    ship_trl("-m", "hydra/launcher=ray_local", *grid, folder=tmp_path, new_process=True)
    assert len(list(tmp_path.rglob("result.json"))) == 2
    home = files(tmp_path / "home")
    assert not any("token" in name for name in home)
    assert not any(re.search(rb"\b[0-9a-f]{64}\b", data) for data in home.values())


def test_a_token_file_is_closed_to_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pathlib.Path.home", lambda: tmp_path)
    for name in ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "RAY_AUTH_MODE"):
        monkeypatch.delenv(name, raising=False)
    path = tmp_path / ".ray" / "auth_token"
    path.parent.mkdir()
    path.write_text("secret")
    path.chmod(0o644)
    close_token(own_cluster=False)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600 and path.read_text() == "secret"
    close_token(own_cluster=True)
    assert "RAY_AUTH_TOKEN" not in os.environ  # the user's own holds
