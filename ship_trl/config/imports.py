"""Import a function that a setting names: `module:function`, or `file.py:function`."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ship_trl.config.errors import ConfigError


def import_function(name: str, key: str) -> Callable[..., Any]:
    """Import a function from a module or a Python file; `key` is the setting that messages name.

    Raises:
        ConfigError: the import fails, or there is no such function.
    """
    where, _, function = name.rpartition(":")
    try:
        if where.endswith(".py"):
            spec = importlib.util.spec_from_file_location(f"ship_trl_user_{Path(where).stem}", where)
            assert spec is not None and spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            # Dataclasses look their module up by name.
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
        else:
            module = importlib.import_module(where)
    except Exception as error:  # a user's file may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ConfigError(f"{key}: {name} cannot be imported: {reason}") from None
    found: Callable[..., Any] | None = getattr(module, function, None)
    if not callable(found):
        raise ConfigError(f"{key}: {where} has no function {function}")
    return found
