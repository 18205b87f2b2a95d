"""Import and call a user's function that a setting names: `module:function`, or `file.py:function`."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import extract_tb
from typing import Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import PACKAGE


@contextmanager
def name_in_errors(title: str) -> Iterator[None]:
    """Turn what a user's code raises into a `ConfigError`: the title, the error, and the user's line."""
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:  # a user's code may raise anything
        frames = [(Path(frame.filename), frame.lineno) for frame in extract_tb(error.__traceback__)]
        places = [
            f" ({path.name}, line {line})"
            for path, line in frames
            if path.is_file() and PACKAGE not in path.parents and "site-packages" not in path.parts
        ]
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ConfigError(f"{title}: {reason}{''.join(places[-1:])}") from error


def digest_function(name: str) -> str:
    """Return the name of a function, with the SHA-256 of its file, not its path."""
    file, _, function = name.rpartition(":")
    is_file = file.endswith(".py")
    return f"{hashlib.sha256(Path(file).read_bytes()).hexdigest()}:{function}" if is_file else name


def import_function(name: str, key: str, *parameters: str) -> Callable[..., Any]:
    """Import a function from a module or a Python file; `key` is the setting that messages name.

    Raises:
        ConfigError: the import fails, there is no such function, or it does not take the parameters.
    """
    where, _, function = name.rpartition(":")
    with name_in_errors(f"{key}: {name} cannot be imported"):
        if where.endswith(".py"):
            spec = importlib.util.spec_from_file_location(f"ship_trl_user_{Path(where).stem}", where)
            assert spec is not None and spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            # Dataclasses look their module up by name.
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
        else:
            module = importlib.import_module(where)
    found: Callable[..., Any] | None = getattr(module, function, None)
    if not callable(found):
        raise ConfigError(f"{key}: {where} has no function {function}")
    signature = inspect.signature(found)
    try:
        signature.bind(*parameters)
    except TypeError:
        allowed = f"def {function}({', '.join(parameters)})"
        raise ConfigError(f"{key}: {name} is {function}{signature}; allowed: {allowed}") from None
    return found
