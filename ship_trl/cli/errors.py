"""Report errors of the command line in one line each, with exit codes."""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from traceback import walk_tb
from typing import NoReturn

from ship_trl.cli.help import VERBS
from ship_trl.config.errors import ConfigError, explain, print_error
from ship_trl.files.disk import DISK


@contextmanager
def refusals(interrupted: str = "interrupted") -> Iterator[None]:
    """Print a `ConfigError` or an `OSError` of a command as one line, and exit with code 1; at Ctrl-C 130."""
    try:
        yield
    except (ConfigError, OSError) as error:
        print_error(explain_file(error) if isinstance(error, OSError) else str(error))
        sys.exit(1)
    except KeyboardInterrupt as error:
        # A training says where it stopped.
        print_error(str(error) or interrupted)
        sys.exit(130)


@contextmanager
def job_errors() -> Iterator[None]:
    """End a run that was stopped, and print the error of one job of a grid as one line.

    In a grid the exception is raised again, because SystemExit would abort the other jobs too.
    """
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    from ship_trl.run.process import TIME_TO_STOP, StoppedError, end_by_signal

    is_single = HydraConfig.get().mode is RunMode.RUN
    try:
        yield
    except StoppedError as error:
        print_error(str(error))
        if is_single:
            sys.exit(128 + error.number)
        # A worker process must not take the next run. But when the first one ends, joblib kills the others,
        # which may still be writing.
        time.sleep(TIME_TO_STOP)
        end_by_signal(error.number)
    except Exception as error:
        if not (line := explain_error(error)):
            raise
        print_error(line)
        if is_single:
            sys.exit(1)
        raise


@contextmanager
def hydra_errors() -> Iterator[None]:
    """Print an error that the user can correct as one line, and exit with code 1.

    Hydra prints its own errors in several lines, but raises them if HYDRA_FULL_ERROR is set. A user who set
    it gets the traceback.
    """
    if os.environ.get("HYDRA_FULL_ERROR", "") not in ("", "0"):
        yield
        return
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        yield
    except KeyboardInterrupt:
        print_error("interrupted; the same command continues from the last checkpoint, if there is one")
        sys.exit(130)
    except Exception as error:
        if not (line := explain_error(error)):
            raise
        in_a_job = "this sweep had a job that was refused: " * isinstance(error, ConfigError)
        print_error(f"{in_a_job}{line}")
        sys.exit(1)


def check_words(words: list[str]) -> None:
    """Check verb and flags; for a wrong one Hydra would print its usage and exit with code 2.

    Raises:
        ConfigError: a verb or a flag is unknown, or a flag lacks its value.
    """
    from hydra._internal.utils import get_args_parser

    def refuse(message: str) -> NoReturn:
        raise ConfigError(f"{message}; keys are given without dashes, as target=4; see --help")

    if words and re.fullmatch(r"[a-z]+", words[0]):
        raise ConfigError(f"{words[0]}: no such verb; allowed: {', '.join(VERBS)}, or overrides as target=4")
    # Python 3.14 checks each help; Hydra 1.3 has one that is no string, in its own parser too.
    argparse.ArgumentParser._check_help = lambda *_: None  # type: ignore[attr-defined]  # noqa: SLF001
    parser = get_args_parser()
    vars(parser)["error"] = refuse
    parser.parse_args(words)


def explain_error(error: Exception) -> str:
    """Explain in one line why a command failed; empty for a fault of the program."""
    import yaml
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from ship_trl.grid.compose import explain_hydra

    match error:
        case ConfigError():
            return str(error)
        case HydraException():
            return explain_hydra(error)
        case OmegaConfBaseException():
            return explain(error)
        case yaml.YAMLError():
            return f"config: not YAML: {' '.join(str(error).split())}"
        case OSError():
            # One that is not about a file or the disk says more with its traceback.
            return explain_file(error) if error.filename is not None or error.errno in DISK else ""
    # For some overrides Hydra raises Python's own errors, as a TypeError for ~network.conv.0. Errors that
    # OmegaConf raises belong to the module that called it.
    names = [str(frame.f_globals.get("__name__", "")) for frame, _ in walk_tb(error.__traceback__)]
    module = next((name for name in reversed(names) if not name.startswith("omegaconf")), "")
    return f"overrides: Hydra cannot read them ({error})" if module.startswith(("hydra", "antlr4")) else ""


def explain_file(error: OSError) -> str:
    """Explain an error of the file system in one line: the file, then the reason."""
    # With two files, as in renaming, the second one is written.
    file = error.filename2 or error.filename or "a file"
    return f"{file}: {error.strerror or error}"
