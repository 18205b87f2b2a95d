"""How a run uses the machine, and how signals stop it."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ship_trl.run.experiment import run_experiment
from ship_trl.run.plan import make_run
from ship_trl.run.process import stop_on_signal
from ship_trl.study.launch import last_episode
from tests.command import environment
from tests.config.test_config import composed


def resident() -> float:
    """Return the resident memory of this process in MB."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="Linux says how much memory is used")
def test_runs_in_one_process_leave_no_memory_files_or_threads(tmp_path: Path) -> None:
    measured = []
    for seed in range(8):
        arm = ("+pair=high", "+arm=FE3") if seed % 4 == 3 else ("target=4", "method=scratch")
        small = ("profile=smoke", "learn.episodes=30", "checkpoint.seconds=0")
        run_experiment(make_run(composed(*small, *arm, f"seed={seed}", f"output={tmp_path}/out")))
        measured.append((resident(), len([*Path("/proc/self/fd").iterdir()]), threading.active_count()))
    warm, last = measured[3], measured[-1]
    assert last[0] < 1.05 * warm[0] and last[1] <= warm[1] + 2 and last[2] <= warm[2]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.fixture(autouse=True)
def heeded() -> Iterator[None]:
    """Handle Ctrl-C, which a process in the background may ignore."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_asks_to_stop(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with stop_on_signal() as stop:
        signal.raise_signal(number)
    assert stop.asked is number
    assert signal.getsignal(number) is before


def test_a_second_ctrl_c_acts_at_once() -> None:
    with stop_on_signal():
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.long
@pytest.mark.parametrize(
    ("send", "number", "grid", "code"),
    [
        # A terminal's Ctrl-C reaches all processes of a grid; a SIGTERM may reach the first alone.
        (os.killpg, signal.SIGINT, "hydra.mode=MULTIRUN", 130),
        (os.killpg, signal.SIGTERM, "-m", -signal.SIGTERM),
        (os.kill, signal.SIGTERM, "-m", -signal.SIGTERM),
    ],
)
def test_a_grid_writes_its_checkpoints_first(
    send: Callable[[int, int], None], number: signal.Signals, grid: str, code: int, tmp_path: Path
) -> None:
    line = ("target=4", "method=scratch", "profile=smoke", "learn.episodes=3000", "seed=0,1", "output=out")
    child = subprocess.Popen(
        [sys.executable, "-m", "ship_trl", grid, *line, "hydra.launcher.n_jobs=2"],
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    runs = [tmp_path / f"out/4/scratch/seed={seed}" for seed in (0, 1)]
    until = time.monotonic() + 300
    while not all(last_episode(run / "curve.csv") > 0 for run in runs) and time.monotonic() < until:
        time.sleep(0.1)
    send(child.pid, number)
    said, _ = child.communicate(timeout=60)
    assert child.returncode == code, said
    for run in runs:
        assert (run / "checkpoint/1.safetensors").is_file(), said
