"""Wrong input: one line for people that names the key and what is allowed. No torch."""

from __future__ import annotations

import dataclasses
import sys

from omegaconf.errors import ConfigKeyError, OmegaConfBaseException, ValidationError

# Characters of a complaint.
LONGEST_LINE = 1000


class ConfigError(Exception):
    """Wrong input; its text is one line for the user, whatever was given."""

    def __str__(self) -> str:
        return one_line(super().__str__())


def one_line(text: str) -> str:
    """Make one line of a text in which line breaks or a terminal's commands may stand, and cut a long one."""
    if len(text) > LONGEST_LINE:
        text = f"{text[: LONGEST_LINE // 2]} ... {text[-LONGEST_LINE // 3 :]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def explain(error: OmegaConfBaseException) -> str:
    """One line for an OmegaConf error: the full key, then what is allowed there."""
    key = error.full_key or str(error.key or "config")
    lines = str(error.msg or error).strip().splitlines() or [type(error).__name__]
    fields = dataclasses.fields(error.object_type) if dataclasses.is_dataclass(error.object_type) else ()
    if isinstance(error, ConfigKeyError) and fields:
        return f"{key}: unknown key; allowed here: {', '.join(f.name for f in fields)}"
    if isinstance(error, ValidationError):
        return f"{key}: {lines[0]}"
    if "missing mandatory value" in lines[0].lower():
        return f"{key}: missing; a value is needed"
    return f"{key}: {lines[0]}"


def print_error(line: str) -> None:
    """Say in one line what is wrong."""
    print(f"ship_trl: {one_line(line)}", file=sys.stderr)
