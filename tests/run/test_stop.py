"""The first Ctrl-C or SIGTERM asks a run to stop, a second Ctrl-C interrupts it at once."""

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ship_trl.run.process import StoppedError, stop_on_signal
from ship_trl.study.launch import last_episode
from tests.command import environment


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


def test_a_pool_can_pickle_the_error() -> None:
    error = pickle.loads(pickle.dumps(StoppedError("stopped", signal.SIGTERM)))
    assert (str(error), error.number) == ("stopped", signal.SIGTERM)


def test_a_process_ends_as_if_the_signal_killed_it() -> None:
    code = (
        "import signal; from ship_trl.run.process import end_by_signal\n"
        "print('last words'); end_by_signal(signal.SIGTERM)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, env=os.environ
    )
    assert (done.returncode, done.stdout) == (-signal.SIGTERM, "last words\n")


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
