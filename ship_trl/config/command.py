"""Write commands that are printed or started, so that a shell and Hydra read back what was meant."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

# What Hydra reads without quotes as the same text: no number in another spelling, and none of its words.
PLAIN = re.compile(r"(?!(?:null|true|false|nan|inf)$)[a-z_/][\w./-]*|0|[1-9]\d*", re.ASCII | re.IGNORECASE)


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
