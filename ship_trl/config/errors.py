"""Errors of input: one line for people that names the key and what is allowed. No torch."""

from __future__ import annotations

import sys

from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.paths import PACKAGE

# Characters of an error; a longer one is shortened in the middle.
MAX_LINE_LENGTH = 1000


class ConfigError(Exception):
    """Wrong input; its text is always one line for the user."""

    def __str__(self) -> str:
        return one_line(super().__str__())


def one_line(text: str) -> str:
    """Escape line breaks and control characters of a text, and shorten a long one."""
    if len(text) > MAX_LINE_LENGTH:
        text = f"{text[: MAX_LINE_LENGTH // 2]} ... {text[-MAX_LINE_LENGTH // 3 :]}"
    return escape(text)


def escape(text: str) -> str:
    """Escape line breaks and control characters of a text."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def explain(error: OmegaConfBaseException) -> str:
    """Explain an OmegaConf error in one line: the full key, then what is allowed there."""
    key = error.full_key or str(error.key or "config")
    lines = str(error.msg or error).strip().splitlines() or [type(error).__name__]
    if "missing mandatory value" in lines[0].lower():
        return f"{key}: missing; a value is needed"
    return f"{key}: {lines[0]}"


def missing_extra(package: str, extra: str) -> str:
    """Return the message that a package is not installed, with the command that installs its extra."""
    is_checkout = (PACKAGE.parent / "pyproject.toml").is_file()
    # No index has this package.
    where, how = ("", "-e ") if is_checkout else (" in a checkout", "")
    return f"{package} is not installed; run{where}: pip install {how}'.[{extra}]'"


def print_error(line: str) -> None:
    """Print an error on stderr as one line."""
    print(f"ship_trl: {one_line(line)}", file=sys.stderr)
