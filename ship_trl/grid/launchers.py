"""Fix two problems of Hydra's launchers: processes that outlive them, and Ray's world-readable token."""

from __future__ import annotations

import contextlib
import ctypes
import os
import secrets
import shutil
import signal
import sys
import time
from collections.abc import Sequence
from multiprocessing import current_process
from pathlib import Path
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.run.process import TIME_TO_STOP, end_by_signal

TOKEN, TOKEN_PATH, MODE = "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "RAY_AUTH_MODE"
RAY = "hydra_plugins.hydra_ray_launcher"
# Environment variable: id of the process that starts the processes of a grid.
LAUNCHER = "SHIP_TRL_LAUNCHER"
# Environment variable: how many runs a grid has.
GRID = "SHIP_TRL_GRID"
# Prefix of the names of joblib's processes.
JOBLIB = "LokyProcess"
# Option of Linux's prctl: send a signal when the parent dies.
PR_SET_PDEATHSIG = 1


def mark_launcher() -> None:
    """Set the environment variable that marks this process as the launcher of a grid."""
    os.environ[LAUNCHER] = str(os.getpid())


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
        for child in children():
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, number)
        time.sleep(2 * TIME_TO_STOP)
        end_by_signal(signal.Signals(number))

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, wait)
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_IGN:
        signal.signal(signal.SIGTERM, forward)


def children() -> list[int]:
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
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


class CountRuns(Callback):
    """Tells the processes of a grid how many runs the grid has, and lets them stop cleanly."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Prepare before the launcher starts."""
        install_signal_handlers()
        folder = Path(config.hydra.sweep.dir)
        for path in (folder / "multirun.yaml", folder / ".submitit"):
            if path.is_symlink():
                exit_with(f"output: {path} is a link; allowed: only output= itself may be one")
        count = OmegaConf.select(config.hydra.sweeper, "n_trials") or len(list_runs(config))
        if count:
            os.environ[GRID] = str(count)


def list_runs(config: DictConfig) -> list[Sequence[str]]:
    """List the overrides of each run of a grid; empty if a sweeper chooses them during the sweep."""
    sweeper = config.hydra.sweeper
    if not str(sweeper.get("_target_")).endswith(BasicSweeper.__name__):
        return []
    params = sweeper.get("params") or {}
    # Unresolved, because ${learn.lr} may have another value in each run.
    task: Any = OmegaConf.to_container(config.hydra.overrides.task, resolve=False)
    words = [*(f"{key}={value}" for key, value in params.items()), *task]
    try:
        given = OverridesParser.create().parse_overrides(words)
        return [run for batch in BasicSweeper.split_arguments(given, None) for run in batch]
    except HydraException:  # Hydra reports this error itself
        return []


def exit_with(line: str) -> None:
    """Print an error and exit: Hydra turns exceptions of a callback into warnings."""
    print_error(line)
    sys.exit(1)


def place_in_grid(number: int) -> str:
    """Return the place of a run in its grid, such as `3 of 40`; `number` counts from 0."""
    return f"{number + 1} of {os.environ.get(GRID, '?')}"


def check_slurm(launcher: str, key: str) -> None:
    """Raise a `ConfigError` if Slurm's launcher was chosen and there is no cluster."""
    if launcher == "slurm" and shutil.which("sbatch") is None:
        raise ConfigError(f"{key}: slurm needs sbatch, which is not found here; allowed: slurm_local, joblib")


class PrivateToken(Callback):
    """Hides Ray's token from other users of the machine.

    If Ray starts a cluster, it writes the cluster's token into `~/.ray/auth_token`, which everyone can read.
    The cluster ends with the grid, so the token can stay in memory. An existing file is made private.
    """

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Hide the token before the launcher starts."""
        launcher = config.hydra.launcher
        if str(launcher.get("_target_")).startswith(RAY):
            close_token(own_cluster=OmegaConf.select(launcher, "ray.init.address") in (None, "local"))


def close_token(own_cluster: bool) -> None:
    """Make an existing token file private. If there is none, set the token of our own cluster in memory."""
    path = Path.home() / ".ray" / "auth_token"
    if path.is_file() and path.stat().st_mode & 0o077:
        path.chmod(0o600)
    elif own_cluster and not path.exists() and not {TOKEN, TOKEN_PATH} & os.environ.keys():
        os.environ.setdefault(MODE, "token")
        os.environ[TOKEN] = secrets.token_hex(32)
