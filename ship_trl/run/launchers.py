"""Close gaps of Hydra's launchers: processes that outlive them, and Ray's world-readable token."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import secrets
import shutil
import signal
import sys
import time
from multiprocessing import current_process
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.run.stop import TIME_TO_STOP, die_of

TOKEN, TOKEN_PATH, MODE = "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "RAY_AUTH_MODE"
RAY = "hydra_plugins.hydra_ray_launcher"
# Environment variable: id of the process that starts those of a grid.
LAUNCHER = "SHIP_TRL_LAUNCHER"
# Environment variable: how many runs a grid has.
GRID = "SHIP_TRL_GRID"
# Prefix of the names of joblib's processes.
JOBLIB = "LokyProcess"
# Option of Linux's prctl: send a signal when the parent dies.
PR_SET_PDEATHSIG = 1


def mark_launcher() -> None:
    """Write down that this process is the one that may start others."""
    os.environ[LAUNCHER] = str(os.getpid())


def let_runs_stop() -> None:
    """On Ctrl-C and SIGTERM, give the processes of a grid time to write their checkpoints.

    Ctrl-C reaches them too, but joblib would kill them at once. A second Ctrl-C does not wait. SIGTERM is
    forwarded to them: they would be signalled when this process ends, but in a container the end of the
    first process kills all others with it.
    """

    def wait(*_: object) -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        time.sleep(2 * TIME_TO_STOP)
        raise KeyboardInterrupt

    def pass_on(number: int, _: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        for child in children():
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, number)
        time.sleep(2 * TIME_TO_STOP)
        die_of(signal.Signals(number))

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, wait)
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_IGN:
        signal.signal(signal.SIGTERM, pass_on)


def children() -> list[int]:
    """List the child processes; empty on systems without /proc."""
    try:
        words = [path.read_text() for path in Path("/proc/self/task").glob("*/children")]
    except OSError:
        return []
    return [int(word) for word in " ".join(words).split()]


def die_with_launcher() -> None:
    """In a process of a grid: end when the launcher ends, even if it is killed.

    Otherwise it would finish its run beside those of a restarted grid, on the same cores. Processes of
    joblib are always children of the launcher: with another parent they are orphans already.
    """
    launcher = os.environ.get(LAUNCHER)
    if launcher is not None and (launcher == str(os.getppid()) or current_process().name.startswith(JOBLIB)):
        die_with_parent()
        if str(os.getppid()) != launcher:  # the launcher has ended before the line above
            os.kill(os.getpid(), signal.SIGTERM)


def die_with_parent() -> None:
    """In a child process: end when the parent ends, however it ends. It works on Linux only."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    except (AttributeError, OSError, TypeError):
        return


class CountRuns(Callback):
    """Tells the processes of a grid how many runs it has, and lets them stop cleanly."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Prepare before the launcher starts."""
        let_runs_stop()
        refuse_linked_files(Path(config.hydra.sweep.dir))
        sweeper = config.hydra.sweeper
        runs = OmegaConf.select(sweeper, "n_trials")
        if runs is None:
            params = sweeper.get("params") or {}
            words = [*config.hydra.overrides.task, *(f"{key}={value}" for key, value in params.items())]
            try:
                given = OverridesParser.create().parse_overrides(words)
                runs = math.prod(len(list(one.sweep_iterator())) for one in given if one.is_sweep_override())
            except HydraException:
                # Hydra itself reports what is wrong, or its sweeper has another syntax.
                return
        os.environ[GRID] = str(runs)


def refuse_linked_files(folder: Path) -> None:
    """Exit if Hydra or submitit would write the files of a grid through a link."""
    for path in (folder / "multirun.yaml", folder / ".submitit"):
        if path.is_symlink():
            print_error(f"output: {path} is a link; allowed: only output= itself may be one")
            # Hydra turns exceptions of a callback into warnings.
            sys.exit(1)


def place_in_grid(number: int) -> str:
    """Return the place of a run in its grid, such as `3 of 40`; `number` counts from 0."""
    return f"{number + 1} of {os.environ.get(GRID, '?')}"


def check_slurm(launcher: str, key: str) -> None:
    """Check that there is a Slurm cluster if its launcher was chosen.

    Raises:
        ConfigError: there is no cluster.
    """
    if launcher == "slurm" and shutil.which("sbatch") is None:
        raise ConfigError(f"{key}: slurm needs sbatch, which is not found here; allowed: slurm_local, joblib")


class PrivateToken(Callback):
    """Hides Ray's token from other users of the machine.

    Ray would write the token of a cluster that it starts itself into `~/.ray/auth_token`, readable by
    everyone. Such a cluster ends with the grid, so its token can stay in memory. An existing file is made
    readable by its owner only.
    """

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Hide the token before the launcher starts."""
        launcher = config.hydra.launcher
        if str(launcher.get("_target_")).startswith(RAY):
            close_token(own_cluster=OmegaConf.select(launcher, "ray.init.address") in (None, "local"))


def close_token(own_cluster: bool) -> None:
    """Make an existing token file private; without one, give our own cluster a token in memory."""
    path = Path.home() / ".ray" / "auth_token"
    if path.is_file() and path.stat().st_mode & 0o077:
        path.chmod(0o600)
    elif own_cluster and not path.exists() and not {TOKEN, TOKEN_PATH} & os.environ.keys():
        os.environ.setdefault(MODE, "token")
        os.environ[TOKEN] = secrets.token_hex(32)
