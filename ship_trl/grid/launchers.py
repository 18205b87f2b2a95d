"""Let the processes of a grid stop cleanly, and none outlive its launcher."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import time
from multiprocessing import current_process
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.run.process import TIME_TO_STOP, call_glibc, end_by_signal

# Environment variable: id of the process that starts the processes of a grid.
LAUNCHER = "SHIP_TRL_LAUNCHER"
# Environment variable: how many runs a grid has.
GRID = "SHIP_TRL_GRID"
# Prefix of the names of joblib's processes.
JOBLIB = "LokyProcess"
# Option of Linux's prctl: send a signal when the parent dies.
PR_SET_PDEATHSIG = 1


def install_signal_handlers() -> None:
    """On Ctrl-C and SIGTERM, give the processes of a grid time to write their checkpoints.

    Ctrl-C reaches them too, but joblib would kill them at once, so this process waits. A second Ctrl-C does
    not wait. SIGTERM is forwarded to them. Otherwise they would get it only when this process ends, which is
    too late in a container: the end of its first process kills all others.
    """

    def wait(*_: object) -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        time.sleep(2 * TIME_TO_STOP)
        raise KeyboardInterrupt

    def forward(number: int, _: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        for child in child_processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, number)
        time.sleep(2 * TIME_TO_STOP)
        end_by_signal(signal.Signals(number))

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, wait)
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_IGN:
        signal.signal(signal.SIGTERM, forward)


def child_processes() -> list[int]:
    """List the child processes; empty on systems without /proc."""
    try:
        words = [path.read_text() for path in Path("/proc/self/task").glob("*/children")]
    except OSError:
        return []
    return [int(word) for word in " ".join(words).split()]


def die_with_launcher() -> None:
    """In a process of a grid: end when the launcher ends, even if the launcher is killed.

    Otherwise the process would continue its run, and share the cores with a restarted grid. Processes of
    joblib are children of the launcher: if one has another parent, the launcher has ended already.
    """
    launcher = os.environ.get(LAUNCHER)
    if launcher is not None and (launcher == str(os.getppid()) or current_process().name.startswith(JOBLIB)):
        die_with_parent()
        if str(os.getppid()) != launcher:  # the launcher has ended before the line above
            os.kill(os.getpid(), signal.SIGTERM)


def die_with_parent() -> None:
    """In a child process: end when the parent ends for any reason; on Linux only."""
    call_glibc("prctl", PR_SET_PDEATHSIG, signal.SIGTERM)


def check_slurm(launcher: str, key: str) -> None:
    """Raise a `ConfigError` if Slurm's launcher was chosen and there is no cluster."""
    if launcher == "slurm" and shutil.which("sbatch") is None:
        raise ConfigError(f"{key}: slurm needs sbatch, which is not found here; allowed: slurm_local, joblib")
