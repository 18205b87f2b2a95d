"""Lines for people: errors that name the key and what is allowed, and commands to paste. No torch."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.paths import PACKAGE

# Characters of an error; a longer one is shortened in the middle.
MAX_LINE_LENGTH = 1000
# What Hydra reads without quotes as the same text: no number in another spelling, and none of its words.
PLAIN = re.compile(r"(?!(?:null|true|false|nan|inf)$)[a-z_/][\w./-]*|0|[1-9]\d*", re.ASCII | re.IGNORECASE)


class ConfigError(Exception):
    """Wrong input; its text is always one line for the user."""

    def __str__(self) -> str:
        return one_line(super().__str__())


def require(condition: bool, key: str, allowed: str, got: object) -> None:
    """Raise a `ConfigError` that names `key`, what is `allowed` and what was given, if a condition fails."""
    if not condition:
        raise ConfigError(f"{key}: must be {allowed}, got {got}")


def one_line(text: str) -> str:
    """Escape line breaks and control characters of a text, and shorten a long one."""
    if len(text) > MAX_LINE_LENGTH:
        text = f"{text[: MAX_LINE_LENGTH // 2]} ... {text[-MAX_LINE_LENGTH // 3 :]}"
    return escape(text)


def escape(text: str) -> str:
    """Escape line breaks and control characters of a text."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def explain(error: OmegaConfBaseException) -> str:
    """Explain an OmegaConf error in one line: the full key, then the reason."""
    key = error.full_key or str(error.key or "config")
    return f"{key}: {str(error.msg or error).strip().partition(chr(10))[0]}"


def missing_extra(package: str, extra: str) -> str:
    """Return the message that a package is not installed, with the command that installs its extra."""
    is_checkout = (PACKAGE.parent / "pyproject.toml").is_file()
    # No index needs to have this package: pip takes the one that is installed.
    what = "-e '." if is_checkout else f"'{PACKAGE.name}"
    return f"{package} is not installed; run: pip install {what}[{extra}]'"


def print_error(line: str) -> None:
    """Print an error on stderr as one line."""
    print(f"ship_trl: {one_line(line)}", file=sys.stderr)


def counted(items: int, noun: str) -> str:
    """Write a count: "no seeds", "1 seed", "2 seeds"."""
    return f"{items or 'no'} {noun}{'' if items == 1 else 's'}"


def command(*words: str | Path) -> str:
    """Return the line of a shell that runs `python -m ship_trl` with the words; no path looks like a flag."""
    safe = (
        f"./{word}" if isinstance(word, Path) and re.match(r"-|[\w.]+=", str(word)) else str(word)
        for word in words
    )
    return shlex.join(["python", "-m", "ship_trl", *safe])


def override(key: str, value: object) -> str:
    """Return the word `key=value` for Hydra, quoted where its grammar would read another text."""
    text = str(value)
    if not PLAIN.fullmatch(text):
        # A backslash counts only before a quote, as the closing one.
        text = re.sub(r"\\+(?='|\Z)", lambda found: 2 * found[0], text).replace("'", "\\'")
        text = f"'{text}'"
    return f"{key}={text}"
