"""Errors of the command line in one line, and exit codes."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from traceback import walk_tb
from typing import NoReturn

from ship_trl.cli.help import VERBS
from ship_trl.config.errors import print_error
from ship_trl.config.hydra import explain_hydra
from ship_trl.files.disk import DISK


@contextmanager
def refusals() -> Iterator[None]:
    """Around a command: what is wrong with its input, or a file that cannot be written, in one line."""
    from ship_trl.config.errors import ConfigError

    try:
        yield
    except ConfigError as error:
        print_error(str(error))
        sys.exit(1)
    except OSError as error:
        print_error(explain_file(error))
        sys.exit(1)


@contextmanager
def job_errors() -> Iterator[None]:
    """Around one job: its own `ConfigError`, or a file that cannot be written, in one line.

    A single run ends with it. In a sweep it goes on as an exception, because SystemExit would
    abort the other jobs too.
    """
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    from ship_trl.config.errors import ConfigError
    from ship_trl.run.stop import TIME_TO_STOP, StoppedError, die_of

    try:
        yield
    except StoppedError as error:
        print_error(str(error))
        if HydraConfig.get().mode is RunMode.RUN:
            sys.exit(128 + error.number)
        # A process of a grid would be given the next run. When the first ends, joblib kills the others,
        # which may still write.
        time.sleep(TIME_TO_STOP)
        die_of(error.number)
    except (ConfigError, OSError) as error:
        if not explained(error):
            raise
        print_error(explain_file(error) if isinstance(error, OSError) else str(error))
        if HydraConfig.get().mode is RunMode.RUN:
            sys.exit(1)
        raise


@contextmanager
def hydra_errors() -> Iterator[None]:
    """Turn what is the user's to mend into one line on stderr and exit code 1.

    Hydra prints its own errors over several lines unless HYDRA_FULL_ERROR is set; then it raises
    them. Someone who set it wants the traceback and gets it.
    """
    if os.environ.get("HYDRA_FULL_ERROR", "") not in ("", "0"):
        yield
        return
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        yield
    except KeyboardInterrupt:
        print_error("interrupted; the same command goes on from the last checkpoint, if there is one")
        sys.exit(130)
    except Exception as error:
        line = explain_command(error)
        if line is None:
            raise
        print_error(line)
        sys.exit(1)


def check_words(words: list[str]) -> None:
    """Refuse an unknown verb or flag in one line; Hydra would print its usage and exit with code 2.

    Raises:
        ConfigError: there is one, or a flag lacks its value.
    """
    from hydra._internal.utils import get_args_parser

    from ship_trl.config.errors import ConfigError

    def refuse(message: str) -> NoReturn:
        raise ConfigError(f"{message}; keys are given without dashes, as target=4; see --help")

    if words and re.fullmatch(r"[a-z]+", words[0]):
        raise ConfigError(f"{words[0]}: no such verb; allowed: {', '.join(VERBS)}, or overrides as target=4")
    parser = get_args_parser()
    vars(parser)["error"] = refuse
    parser.parse_args(words)


def explain_command(error: Exception) -> str | None:
    """One line for what ended a command, or None where it is not the user's to mend."""
    import yaml
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from ship_trl.config.errors import ConfigError, explain

    match error:
        case ConfigError():
            return f"this sweep had a job that was refused: {error}"
        case HydraException():
            return explain_hydra(error)
        case OmegaConfBaseException():
            return explain(error)
        case yaml.YAMLError():
            return f"config: not YAML: {' '.join(str(error).split())}"
        case OSError():
            return explain_file(error) if explained(error) else None
    # Of some overrides Hydra makes other errors than its own, as a TypeError of hydra/job_logging=[[1]] or of
    # ~network.conv.0.
    if not origin(error).startswith(("hydra", "antlr4")):
        return None
    known = isinstance(error, ValueError)
    return explain_hydra(error) if known else f"overrides: Hydra cannot read them ({error})"


def explained(error: Exception) -> bool:
    """Whether one line says enough of an error; of an `OSError` about no file a traceback says more."""
    return not isinstance(error, OSError) or error.filename is not None or error.errno in DISK


def explain_file(error: OSError) -> str:
    """One line for an error of the file system: the file, then the reason."""
    # Of two files, as in copying and renaming, the second is written.
    file = error.filename2 or error.filename or "a file"
    return f"{file}: {error.strerror or error}"


def origin(error: BaseException) -> str:
    """Name the module in which an error was raised; of what OmegaConf raises, the one that called it."""
    names = [str(frame.f_globals.get("__name__", "")) for frame, _ in walk_tb(error.__traceback__)]
    return next((name for name in reversed(names) if not name.startswith("omegaconf")), "")
