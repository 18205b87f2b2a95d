"""Made-up AIS traffic, written as the true sources write it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pandas

from ship_trl.config.bounds import KNOT
from ship_trl.formats.ais import Fixes, clean, find_columns, sort_fixes
from ship_trl.formats.situation import metres_per_degree

# 1 June 2025, 00:00 UTC.
START = 1_748_736_000
LATITUDE, LONGITUDE = 56.0, 11.0


class Track(NamedTuple):
    """A ship's start (m), course (degrees) and speed (knots), and from when on it turns how much."""

    x: float
    y: float
    course: float
    knots: float
    turns_at: float = math.inf
    turns_by: float = 0.0


def make(tracks: Sequence[Track], minutes: int = 20, every: int = 10) -> pandas.DataFrame:
    """Return rows of mmsi, time (s since 1970), place, sog and cog of all ships, sorted by time."""
    east, north = metres_per_degree(LATITUDE)
    rows = []
    for number, track in enumerate(tracks):
        x, y = track.x, track.y
        for second in range(0, 60 * minutes + 1, every):
            course = (track.course + (track.turns_by if second >= track.turns_at else 0.0)) % 360.0
            place = LATITUDE + y / north, LONGITUDE + x / east
            rows.append((219_000_001 + number, START + second, *place, track.knots, course))
            way = track.knots * KNOT * every
            x, y = x + way * math.sin(math.radians(course)), y + way * math.cos(math.radians(course))
    return pandas.DataFrame(rows, columns=["mmsi", "time", "lat", "lon", "sog", "cog"]).sort_values(
        ["time", "mmsi"], ignore_index=True
    )


def stamps(rows: pandas.DataFrame, form: str) -> pandas.Series:
    return pandas.to_datetime(rows.time, unit="s").dt.strftime(form)


def marinecadastre_old(rows: pandas.DataFrame) -> pandas.DataFrame:
    """Return MarineCadastre's table of before 2025: courses wrap, nothing available is 102.3 and 360."""
    cog = rows.cog.where(rows.cog <= 204.7, rows.cog - 409.6).round(1)
    return pandas.DataFrame(
        {"MMSI": rows.mmsi, "BaseDateTime": stamps(rows, "%Y-%m-%dT%H:%M:%S"), "LAT": rows.lat.round(5)}
        | {"LON": rows.lon.round(5), "SOG": rows.sog, "COG": cog, "Heading": 511.0, "VesselName": "A"}
        | {"Status": 0, "TransceiverClass": "A"}
    )


def marinecadastre_new(rows: pandas.DataFrame) -> pandas.DataFrame:
    """Return MarineCadastre's table of 2025: longitude before latitude, a blank in the time."""
    return pandas.DataFrame(
        {
            "mmsi": rows.mmsi,
            "base_date_time": stamps(rows, "%Y-%m-%d %H:%M:%S"),
            "longitude": rows.lon.round(5),
        }
        | {"latitude": rows.lat.round(5), "sog": rows.sog, "cog": rows.cog.round(1), "heading": None}
        | {"vessel_name": "A", "status": 0, "transceiver": "A"}
    )


def danish(rows: pandas.DataFrame) -> pandas.DataFrame:
    """Return a daily file of Denmark: the day first, a # before the first name."""
    return pandas.DataFrame(
        {"# Timestamp": stamps(rows, "%d/%m/%Y %H:%M:%S"), "Type of mobile": "Class A", "MMSI": rows.mmsi}
        | {
            "Latitude": rows.lat.round(6),
            "Longitude": rows.lon.round(6),
            "Navigational status": "Unknown value",
        }
        | {"ROT": None, "SOG": rows.sog, "COG": rows.cog.round(1), "Heading": None}
    )


def kystverket(rows: pandas.DataFrame) -> pandas.DataFrame:
    """Return a table of Kystverket; it is written with semicolons."""
    return pandas.DataFrame(
        {"mmsi": rows.mmsi, "date_time_utc": stamps(rows, "%Y-%m-%dT%H:%M:%S"), "lon": rows.lon.round(6)}
        | {"lat": rows.lat.round(6), "sog": rows.sog, "cog": rows.cog.round(1), "true_heading": 511}
    )


TABLES = {
    "marinecadastre_old": (marinecadastre_old, ","),
    "marinecadastre_new": (marinecadastre_new, ","),
    "danish": (danish, ","),
    "danish_old": (danish, ";"),
    "kystverket": (kystverket, ";"),
}


def write(path: Path, rows: pandas.DataFrame, table: str) -> Path:
    make_table, delimiter = TABLES[table]
    make_table(rows).to_csv(path, index=False, sep=delimiter)
    return path


def read_frame(frame: pandas.DataFrame) -> Fixes:
    """Read a table that is in memory."""
    kinds = find_columns([str(name) for name in frame.columns], "the table")
    return sort_fixes([clean(frame.iloc[:, list(kinds)].set_axis([*kinds.values()], axis=1), 1)])


# 12 knots are 6.2 m/s: they meet after 600 s, and pass each other at 50 m.
HEAD_ON = (Track(0, 0, 0, 12), Track(50, 7408, 180, 12))
# The other ship comes from starboard.
CROSSING = (Track(0, 0, 0, 12), Track(3704, 3704, 270, 12))
# The same with a ship that makes 1 knot.
SLOW_CROSSING = (Track(0, 0, 0, 1), Track(3704, 309, 270, 12))
