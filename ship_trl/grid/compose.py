"""Compose configurations by Hydra: words stay as they are typed, and a suite brings its profile. No torch."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import is_dataclass
from functools import cache
from typing import Any

from hydra._internal import hydra as hydra_parts
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from omegaconf import DictConfig, _utils
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Config
from ship_trl.files.untrusted import LOADER
from ship_trl.sim.suites import profile_of

# That of conf/config.yaml.
DEFAULT_PROFILE = "quick"
# Keys of text that `Config` does not know.
TEXT_KEYS = ("algorithm.teacher", "hydra.sweep.dir")
# Functions of Hydra's grammar whose arguments are numbers.
NUMERIC = re.compile(r"\b(range|interval|int|float|bool|json_str|sort)\s*\(")


class Loader(ConfigLoaderImpl):
    """Hydra's loader of configurations, as `use_loader` puts it in place.

    Processes of a grid get it with their run, so that they compose alike.
    """

    def load_configuration(
        self, config_name: str | None, overrides: list[str], *flags: Any, **options: Any
    ) -> DictConfig:
        """Compose a configuration; see `quote_text` and `missing_profile` for what is added to Hydra's."""
        words = [quote_text(word) for word in overrides]
        with decimal_numbers():
            values = super().load_configuration(config_name, words, *flags, **options)
            if profile := missing_profile(values, words):
                words.append(f"profile={profile}")
                values = super().load_configuration(config_name, words, *flags, **options)
        return values


def use_loader() -> None:
    """Let Hydra compose by `Loader` in this process."""
    vars(hydra_parts)["ConfigLoaderImpl"] = Loader


@contextmanager
def decimal_numbers() -> Iterator[None]:
    """Let OmegaConf read YAML as `read_yaml` does."""
    before = _utils.get_yaml_loader
    _utils.get_yaml_loader = lambda: LOADER
    try:
        yield
    finally:
        _utils.get_yaml_loader = before


def missing_profile(values: DictConfig, words: list[str]) -> str:
    """Return the profile that the suite of target or source asks for, empty if none or if one is given."""
    is_given = any(word.lstrip("+").startswith("profile=") for word in words)
    if is_given or values.hydra.runtime.choices.get("profile") != DEFAULT_PROFILE:
        return ""
    try:
        # In a grid of targets each run has one, and the grid has none.
        names = [values.get("target"), values.get("source")] if values.get("target") else []
        return next(filter(None, (profile_of(str(name)) for name in names)), "")
    except (ConfigError, OmegaConfBaseException):  # refused where the suite is loaded
        return ""


def quote_text(word: str) -> str:
    """Quote values of a key of text that Hydra would read as numbers, as in `output=2024_05_01,1e3`."""
    key, equals, value = word.partition("=")
    # A value with quotes, brackets or an interpolation is as its author wants it.
    if set(value) & set("'\"[{$") or not is_text(key.lstrip("+").partition("@")[0]) or NUMERIC.search(value):
        return word
    return key + equals + re.sub(r"[^\s,()]+", lambda found: quote(found[0]), value)


def quote(word: str) -> str:
    """Return a word in quotes if Hydra would read it as a number or a truth value."""
    try:
        float(word)
    except ValueError:
        return f"'{word}'" if word.lower() in ("true", "false") else word
    return f"'{word}'"


@cache
def is_text(key: str) -> bool:
    """Return whether the values of a key are text: names, paths, and options of config groups."""
    if key in TEXT_KEYS or "/" in key:
        return True
    hint: Any = Config
    *groups, last = key.split(".")
    for group in groups:
        hint = typing.get_type_hints(hint).get(group) if is_dataclass(hint) else None
    hints = typing.get_type_hints(hint) if is_dataclass(hint) else {}
    if last not in hints:
        # A group outside conf/config.yaml, such as `+experiment=NAME`.
        return not groups
    # A dataclass, or the dict `algorithm`, is a config group.
    return hints[last] is str or str in typing.get_args(hints[last]) or is_dataclass(hints[last])
