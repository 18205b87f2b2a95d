"""AIS positions as NMEA 0183 sentences with tag blocks, decoded by `pyais`."""

from __future__ import annotations

import math
import re
from array import array
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.formats.ais import KINDS, MAX_SECONDS, Fixes, known_fixes, sort_fixes, whole_lines

# Bits of position reports by their type, up to the end of the course.
LEAST_BITS = {1: 128, 2: 128, 3: 128, 18: 124, 19: 124, 27: 94}


def read_nmea(path: Path) -> Fixes:
    """Read NMEA 0183 sentences of AIS, each with a tag block that says when it was received, by `pyais`.

    Raises:
        ConfigError: pyais is not installed, no sentence has a time, or a line is too long.
    """
    try:
        import pyais
    except ImportError:
        raise ConfigError(f"{path}: {missing_extra('pyais', 'ais')}") from None
    numbers, untimed = array("d"), 0
    with path.open("rb") as file:
        lines = (line for _, piece in whole_lines(file, path) for line in piece.splitlines())
        # A sentence whose checksum is wrong is decoded all the same.
        for message in (one for one in pyais.IterMessages(lines) if one.is_valid):
            if (tags := message.tag_block) is not None:
                tags.init()
            # A tag block with a wrong checksum, or a word for a time, tells no time.
            if (
                tags is None
                or not tags.is_valid
                or not re.fullmatch(r"\d{1,15}", str(tags.receiver_timestamp))
            ):
                untimed += 1
                continue
            time = int(tags.receiver_timestamp)
            # Receivers write seconds or milliseconds.
            numbers.extend(decoded(message, time // 1000 if time > MAX_SECONDS else time))
    if not numbers:
        sentences = f"{untimed} sentences have no time; wanted: tag blocks with c:SECONDS"
        raise ConfigError(
            f"{path}: {sentences if untimed else 'has no position report (1 to 3, 18, 19, 27)'}"
        )
    return sort_fixes([known_fixes(*np.frombuffer(numbers).reshape(-1, len(KINDS)).T)])


def decoded(message: Any, time: int) -> tuple[float, ...]:
    """Return a position report's MMSI, time, place, speed (knots) and course (degrees), else nothing."""
    import pyais

    try:
        report = message.decode()
    except pyais.exceptions.AISBaseException:
        return ()
    # Of a sentence that was cut off, pyais reads the bits that are left as a number.
    if 6 * len(message.payload) < LEAST_BITS.get(report.msg_type, math.inf):
        return ()
    sog, cog = float(report.speed), float(report.course)
    if report.msg_type == 27:
        # A long-range report has sentinels of its own.
        sog, cog = (np.nan if sog >= 63 else sog), (np.nan if cog >= 511 else cog)
    return float(report.mmsi), float(time), float(report.lat), float(report.lon), sog, cog
