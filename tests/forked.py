"""Run our commands in forked children, which need not import torch and compile kernels again.

A child has its own session, folder and standard streams. A command that starts `python -m ship_trl` itself,
as a study does, forks instead.
"""

import atexit
import contextlib
import gc
import importlib
import io
import os
import runpy
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

# Imported before the fork, so that no child has to.
HEAVY = (
    *("ship_trl.run.experiment", "hydra_plugins.hydra_joblib_launcher._core", "ship_trl.study.report.write"),
    *("pandas", "scipy.stats"),
)
TIMEOUT = 300.0


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code (below 0: by a signal; None: it was too slow), and what it printed."""

    code: int | None
    out: str
    err: str
    seconds: float

    @property
    def is_refusal(self) -> bool:
        """Whether it ended with exit code 1, and nothing on stderr but lines of ours."""
        lines = self.err.splitlines()
        return self.code == 1 and bool(lines) and all(line.startswith("ship_trl: ") for line in lines)

    def __str__(self) -> str:
        return f"exit code {self.code} in {self.seconds:.1f} s: {self.err.strip()[-1200:] or self.out[-300:]}"


@cache
def warm_up() -> None:
    """Import all that commands need, and train once, so that every kernel is compiled."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in HEAVY:
            importlib.import_module(name)
    import torch

    torch.set_num_threads(1)
    words = ("profile=smoke", "target=1", "method=scratch", "learn.episodes=2", "learn.jumpstart_draws=0")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        with contextlib.redirect_stdout(io.StringIO()):
            call(words)
        torch.set_flush_denormal(False)
    # A child that collects garbage would copy and search all of this.
    gc.collect()
    gc.freeze()


def call(words: Sequence[str]) -> None:
    """Call the command line in this process."""
    before, sys.argv = sys.argv, ["ship_trl", *words]
    try:
        importlib.import_module("ship_trl.__main__").main()
    finally:
        sys.argv = before


class Child:
    """A command in a forked child, with as much of `subprocess.Popen` as our commands and tests use."""

    def __init__(
        self, words: Sequence[str], folder: Path, out: int, err: int, before: Callable[[], None]
    ) -> None:
        self.returncode: int | None = None
        # Else both processes would write what is in them.
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of forking beside threads
            self.pid = os.fork()
        if self.pid == 0:
            run_and_exit(words, folder, (out, err), before)

    def poll(self) -> int | None:
        """Return its exit code, or None while it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float = TIMEOUT) -> int:
        """Wait for its end."""
        end = time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired("ship_trl", timeout)
            time.sleep(0.005)
        return code

    def terminate(self, number: signal.Signals = signal.SIGTERM) -> None:
        """Ask it to end."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it."""
        self.terminate(signal.SIGKILL)

    def __enter__(self) -> "Child":
        return self

    def __exit__(self, *_: object) -> None:
        self.wait()


class Running:
    """A command in a child with a session and streams of its own; `before` is called in the child first."""

    def __init__(self, words: Sequence[str], folder: Path, before: Callable[[], None] = lambda: None) -> None:
        warm_up()
        # Closed when they have been read.
        self._files = [tempfile.TemporaryFile() for _ in range(2)]  # noqa: SIM115
        self._start = time.monotonic()

        def begin() -> None:
            os.setsid()
            before()

        out, err = (file.fileno() for file in self._files)
        self.child = Child(words, folder, out, err, begin)

    def finish(self, timeout: float = TIMEOUT) -> Ended:
        """Wait for its end, and kill it (then its code is None) and what it left running."""
        code = None
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self.child.wait(timeout)
        seconds = time.monotonic() - self._start
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.child.pid, signal.SIGKILL)
        self.child.kill()  # it may have been forked just now, and have no session of its own yet
        self.child.wait()
        out, err = map(read_all, self._files)
        return Ended(code, out, err, seconds)


def run(
    *words: str, folder: Path, before: Callable[[], None] = lambda: None, timeout: float = TIMEOUT
) -> Ended:
    """Run `python -m ship_trl ...` in a folder, as a forked child."""
    return Running(words, folder, before).finish(timeout)


def read_all(file: Any) -> str:
    """Read a file from its beginning, and close it."""
    with file:
        file.seek(0)
        return str(file.read().decode(errors="replace"))


def run_script(path: Path, *words: str, folder: Path) -> Ended:
    """Run a file of Python in a folder, as a forked child."""

    def script() -> NoReturn:
        sys.argv, sys.path[0] = [str(path), *words], str(path.parent)
        runpy.run_path(str(path), run_name="__main__")
        sys.exit(0)

    return run(folder=folder, before=script)


def run_and_exit(
    words: Sequence[str], folder: Path, streams: tuple[int, int], before: Callable[[], None]
) -> NoReturn:
    """Run the command in this process, which ends as a process of its own would."""
    code = 1
    try:
        os.chdir(folder)
        for number, stream in enumerate((os.open(os.devnull, os.O_RDONLY), *streams)):
            os.dup2(stream, number)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        os.environ |= {"COLUMNS": "120", "OMP_NUM_THREADS": "1"}
        os.environ.pop("HYDRA_FULL_ERROR", None)
        warnings.resetwarnings()
        warnings.simplefilter("ignore")
        # What the parent would do at its end is not for the child.
        atexit._clear()
        vars(subprocess)["Popen"] = popen(subprocess.Popen)
        before()
        call(words)
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            atexit._run_exitfuncs()
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def popen(real: Any) -> Callable[..., Any]:
    """Make a `subprocess.Popen` that forks for our commands, and starts all others."""

    def start(line: Sequence[str], **options: Any) -> Any:
        if list(line[:3]) != [sys.executable, "-m", "ship_trl"]:
            return real(line, **options)
        # One run after another in one process: joblib's processes would import everything anew.
        words = ["hydra/launcher=basic" if w == "hydra/launcher=joblib" else w for w in line[3:]]
        words = [word for word in words if not word.startswith("hydra.launcher.n_jobs")]
        out = options["stdout"].fileno()
        return Child(words, Path.cwd(), out, out, options.get("preexec_fn", lambda: None))

    return start
