"""Our commands in forked children: torch is imported and kernels are loaded once, so that a start is quick.

A child has its own session, folder, standard streams and arguments, and ends as the command line ends. What a
command starts by `sys.executable -m ship_trl` is forked in the same way.
"""

import contextlib
import importlib
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

# What a command imports only when it is needed, so that no child has to.
HEAVY = {
    "ship_trl": ("ship_trl.run.experiment", "pandas", "hydra_plugins.hydra_joblib_launcher._core"),
    "ship_trl.study": ("ship_trl.study.report.write", "scipy.stats", "statsmodels.api"),
    "ship_trl.report": ("ship_trl.study.report.write", "scipy.stats", "statsmodels.api"),
    "ship_trl.explain": ("ship_trl.explain.write",),
    "ship_trl.export": ("onnx", "onnxruntime", "onnxscript"),
    "ship_trl.record": ("ship_trl.view.film",),
    "ship_trl.results": ("ship_trl.view.curves", "ship_trl.study.analysis.stability"),
}


@dataclass(frozen=True)
class Done:
    """How a child ended: its exit code, or less than zero by a signal, or None after too long a time."""

    code: int | None
    out: str
    err: str
    seconds: float

    @property
    def refused(self) -> bool:
        """Whether it ended with one line of ours and exit code 1."""
        return self.code == 1 and self.err.startswith("ship_trl: ") and self.err.count("\n") == 1

    @property
    def explained(self) -> bool:
        """Whether it ended with lines of ours alone and exit code 1, as where several files are damaged."""
        lines = self.err.splitlines()
        return self.code == 1 and bool(lines) and all(line.startswith("ship_trl: ") for line in lines)

    def __str__(self) -> str:
        return (
            f"exit code {self.code} after {self.seconds:.1f} s: {self.err.strip()[-1200:] or self.out[-300:]}"
        )


@cache
def load(module: str) -> None:
    """Import all that a command needs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in (module, *HEAVY.get(module, ())):
            importlib.import_module(name)


@cache
def warm() -> None:
    """Train once in this process, so that every kernel is loaded."""
    load("ship_trl")
    import torch

    torch.set_num_threads(1)
    arguments, place = sys.argv, Path.cwd()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        os.chdir(folder)
        sys.argv = ["ship_trl", "profile=smoke", "target=1", "method=scratch", "learn.episodes=2"]
        try:
            importlib.import_module("ship_trl.__main__").main()
        finally:
            sys.argv = arguments
            os.chdir(place)
            torch.set_flush_denormal(False)


class Child:
    """A command that goes on in a child."""

    def __init__(
        self,
        arguments: Sequence[str],
        folder: Path,
        module: str = "ship_trl",
        before: Callable[[], None] = lambda: None,
    ) -> None:
        warm()
        load(module)
        # Closed when they have been read.
        self._out, self._err = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115
        self._started = time.monotonic()
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of forking beside threads
            self.pid = os.fork()
        if self.pid == 0:
            os.setsid()
            become(arguments, module, folder, (self._out.fileno(), self._err.fileno()), before)

    def wait(self, seconds: float | None = None) -> Done | None:
        """Wait for its end; None if it goes on after so many seconds."""
        until = None if seconds is None else time.monotonic() + seconds
        while True:
            ended, status = os.waitpid(self.pid, 0 if until is None else os.WNOHANG)
            if ended:
                return self._done(os.waitstatus_to_exitcode(status))
            if until is not None and time.monotonic() > until:
                return None
            time.sleep(0.005)

    def kill(self, group: bool = True) -> Done | None:
        """Kill it, or all of its session, and give how it ended."""
        # Before its end is asked for: the group is gone with its last process. One that was forked just now
        # has none of its own yet.
        try:
            (os.killpg if group else os.kill)(self.pid, signal.SIGKILL)
        except ProcessLookupError:
            os.kill(self.pid, signal.SIGKILL)
        return self.wait()

    def finish(self, limit: float) -> Done:
        """Wait for its end for so many seconds, then kill it."""
        done = self.wait(limit)
        if done is None:
            killed = self.kill()
            assert killed is not None
            done = replace(killed, code=None)
        # Whatever it has left behind.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        return done

    def _done(self, code: int | None) -> Done:
        seconds = time.monotonic() - self._started
        return Done(code, whole_text(self._out), whole_text(self._err), seconds)


def whole_text(file: Any) -> str:
    """Read what a child has said, and close the file."""
    with file:
        file.seek(0)
        return str(file.read().decode(errors="replace"))


def run(
    *arguments: str,
    folder: Path,
    module: str = "ship_trl",
    before: Callable[[], None] = lambda: None,
    limit: float = 300.0,
) -> Done:
    """Run `python -m <module> ...` in a folder, as a forked child; `before` is called in it first."""
    return Child(arguments, folder, module, before).finish(limit)


def become(
    arguments: Sequence[str], module: str, folder: Path, streams: tuple[int, int], before: Callable[[], None]
) -> NoReturn:
    """Be the command in this process, and end it."""
    code = 1
    try:
        os.chdir(folder)
        nothing = os.open(os.devnull, os.O_RDONLY)
        for number, stream in enumerate((nothing, *streams)):
            os.dup2(stream, number)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        sys.argv = [module, *arguments]
        os.environ |= {"COLUMNS": "120", "OMP_NUM_THREADS": "1"}
        os.environ.pop("HYDRA_FULL_ERROR", None)
        warnings.resetwarnings()
        warnings.simplefilter("ignore")
        real, popen = subprocess.Popen, vars(subprocess)
        popen["Popen"] = lambda line, **given: forked(real, line, **given)
        name = f"{module}.__main__" if is_package(module) else module
        main = importlib.import_module(name).main
        before()
        main()
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def is_package(module: str) -> bool:
    """Whether `python -m` takes its `__main__`."""
    return hasattr(importlib.import_module(module), "__path__")


def forked(real: Any, line: Sequence[str], **given: Any) -> Any:
    """Stand for `subprocess.Popen` in a child: what starts our command is forked, the rest is started."""
    if list(line[:2]) != [sys.executable, "-m"] or not line[2].startswith("ship_trl"):
        return real(line, **given)
    return Forked(line, **given)


class Forked:
    """As much of `subprocess.Popen` as our commands ask of it."""

    def __init__(
        self,
        line: Sequence[str],
        stdout: Any = None,
        stderr: Any = None,
        stdin: Any = None,
        preexec_fn: Callable[[], None] = lambda: None,
        text: bool = False,
    ) -> None:
        # Closed when it has been read.
        self._said = tempfile.TemporaryFile() if stderr == subprocess.PIPE else None  # noqa: SIM115
        self.returncode: int | None = None
        out = os.open(os.devnull, os.O_WRONLY) if stdout == subprocess.DEVNULL else stdout.fileno()
        err = self._said.fileno() if self._said else out
        sys.stdout.flush()
        self.pid = os.fork()
        if self.pid == 0:
            # One after the other in one process: joblib's would be started anew, and import everything.
            words = ["hydra/launcher=basic" if w == "hydra/launcher=joblib" else w for w in line[3:]]
            words = [word for word in words if not word.startswith("hydra.launcher.n_jobs")]
            become(words, line[2], Path.cwd(), (out, err), preexec_fn)

    def poll(self) -> int | None:
        """Give its exit code, None while it goes on."""
        if self.returncode is None:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            if ended:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end."""
        until = None if timeout is None else time.monotonic() + timeout
        while self.poll() is None:
            if until is not None and time.monotonic() > until:
                raise subprocess.TimeoutExpired("ship_trl", timeout or 0.0)
            time.sleep(0.01)
        assert self.returncode is not None
        return self.returncode

    def communicate(self) -> tuple[str, str]:
        """Wait for its end, and give what it said on stderr."""
        self.wait()
        assert self._said is not None
        return "", whole_text(self._said)

    def terminate(self) -> None:
        """Ask it to end."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self._send(signal.SIGKILL)

    def _send(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def __enter__(self) -> "Forked":
        return self

    def __exit__(self, *_: object) -> None:
        self.wait()
