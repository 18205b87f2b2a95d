"""Check the function that builds the learner, and the keys that it reads. No torch.

A bundled algorithm says itself what it reads, in the module `settings` beside its own: `READS` there has an
entry by the name of its module. A builder of one's own takes any keys.
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import PACKAGE, is_path
from ship_trl.config.schema import read_as
from ship_trl.config.types import Learn

ALLOWED = "module:function or file.py:function"


@dataclass(frozen=True)
class Reads:
    """What an algorithm reads.

    Attributes:
        settings: the dataclass of its own keys; a method `check` gets `learn`.
        ignored: keys of others that it does not read.
        is_default: whether files and digests leave it out.
        is_on_policy: whether it learns from its own actions alone, without replay and Q-values.
        is_distilled: whether it learns the Q-values of a teacher.
        batch_key: its own key that says how many pictures are computed at once.
        unnamed_without: its own keys that files and digests leave out where the key before them is 0.
    """

    settings: type
    ignored: tuple[str, ...] = ()
    is_default: bool = False
    is_on_policy: bool = False
    is_distilled: bool = False
    batch_key: str = ""
    unnamed_without: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass
class AnyKeys:
    """The keys of a builder that says nothing of them."""


UNKNOWN = Reads(AnyKeys)


def reads_of(algorithm: Mapping[str, Any]) -> Reads:
    """Return what an algorithm reads; `UNKNOWN` if it does not say."""
    package, _, name = str(algorithm["build"]).rpartition(":")[0].rpartition(".")
    settings = f"{package}.settings"
    # Files may name any package, which must not be imported for that.
    if not package.startswith(f"{PACKAGE.name}.") or not is_installed(settings):
        return UNKNOWN
    found: Reads = getattr(importlib.import_module(settings), "READS", {}).get(name, UNKNOWN)
    return found


def is_installed(module: str) -> bool:
    """Return whether a module can be found; it is not imported."""
    try:
        return importlib.util.find_spec(module) is not None
    except (ValueError, ImportError):  # a module without a spec, as `__main__`, or in no package
        return False


def read_algorithm(values: dict[str, Any], learn: Learn) -> dict[str, Any]:
    """Check `build` and the keys that it reads; return them with their types.

    Raises:
        ConfigError: `build` names no function, its file or package is missing, or a key is unknown or wrong.
    """
    options = dict(values)
    build = options.pop("build", None)
    where, _, function = build.rpartition(":") if isinstance(build, str) else ("", "", "")
    is_file, package = where.endswith(".py"), where.split(".")[0]
    if not function.isidentifier() or not (is_file or all(map(str.isidentifier, where.split(".")))):
        raise ConfigError(f"algorithm.build: must be {ALLOWED}, got {build}")
    if is_file and not (is_path(where) and Path(where).is_file()):
        raise ConfigError(f"algorithm.build: no file {where}; allowed: {ALLOWED}")
    if not is_file and not is_installed(package):
        raise ConfigError(f"algorithm.build: no module {package}; allowed: {ALLOWED}")
    if (reads := reads_of(values)) is UNKNOWN:
        return values
    settings: Any = read_as(reads.settings, options, key="algorithm")
    if hasattr(settings, "check"):
        settings.check(learn)
    return {"build": build, **dataclasses.asdict(settings)}


def ignored_keys(algorithm: Mapping[str, Any], words: Iterable[str]) -> list[str]:
    """Return the keys of a command line that an algorithm does not read."""
    keys = (word.partition("=")[0].lstrip("+") for word in words)
    return [key for key in keys if key in reads_of(algorithm).ignored]


def non_default_algorithm(algorithm: dict[str, Any]) -> dict[str, Any] | None:
    """Return the values of `algorithm` that files and digests hold; None for the paper's."""
    reads = reads_of(algorithm)
    if reads.is_default:
        return None
    unnamed = {key for first, keys in reads.unnamed_without.items() if not algorithm[first] for key in keys}
    return {key: value for key, value in algorithm.items() if key not in unnamed}
