"""What a checkpoint says of itself, read without torch."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from safetensors import SafetensorError, safe_open

from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as

# Its key in the metadata of a safetensors file.
HEADER_KEY = "ship_trl"


@dataclass(frozen=True)
class About:
    """The header of a checkpoint: its run, how it was computed, and how far the training was.

    With another arithmetic than `computed` (`Parts.computed`) the resumed run would have other bits.
    `extended` are the episodes at which the runs ended that this one goes on from.
    """

    config_hash: str
    computed: str
    episode: int
    episodes: int
    steps: int
    seconds: float
    extended: list[int]


def read_header(path: Path) -> About | None:
    """Read the header of a checkpoint; None if there is none, or it cannot be read."""
    try:
        with safe_open(path, framework="numpy") as file:
            values = json.loads((file.metadata() or {})[HEADER_KEY])
        return read_as(About, values, from_json=True)
    except (SafetensorError, OSError, ValueError, RecursionError, LookupError, ConfigError):
        return None
