"""AIS positions: tables of MarineCadastre (old, new), Denmark and Kystverket, DataFrames, NMEA sentences.

Of all columns six are read, by their names: see `ALIASES`. Every value that means "not available", or lies
outside what a message can hold, becomes missing (NaN) here and nowhere later. Rows may come in any order.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.bounds import KNOT
from ship_trl.config.errors import ConfigError, missing_extra

if TYPE_CHECKING:
    from pandas import DataFrame

# Names of a column in lower case, without a leading #. A heading is not read: half of a day has none.
ALIASES = {
    "time": ("basedatetime", "base_date_time", "timestamp", "date_time_utc", "time"),
    "mmsi": ("mmsi",),
    "latitude": ("lat", "latitude"),
    "longitude": ("lon", "longitude"),
    "sog": ("sog",),
    "cog": ("cog",),
}
# Where the column is there, only ships with a transceiver of class A or B are kept.
CLASSES = ("transceiverclass", "transceiver", "type of mobile")
ROWS_AT_ONCE = 250_000
# A larger number of a tag block is a time in milliseconds: in seconds it is the year 5138.
MAX_SECONDS = 10**11
# Knots. Above, a message means "not available" (102.3), or "102.2 or more".
MAX_SPEED = 50.0
COMPRESSIONS = {b"PK\x03\x04": "zip", b"\x28\xb5\x2f\xfd": "zstd"}


class Fixes(NamedTuple):
    """Positions of ships, sorted by ship and time, one for each ship and second.

    Each array has a row for each fix: `ship`, a number from 0 without gaps; `time`, seconds since 1970 (UTC);
    degrees; speed over ground in m/s and course over ground in degrees, NaN where missing.
    """

    ship: NDArray[np.int32]
    time: NDArray[np.int64]
    latitude: NDArray[np.float64]
    longitude: NDArray[np.float64]
    speed: NDArray[np.float32]
    course: NDArray[np.float32]


def read_table(path: Path) -> Fixes:
    """Read a table of AIS positions, plain or compressed (zip, zst), in bounded memory.

    Raises:
        ConfigError: the file is no such table; it names the columns that are missing.
    """
    import pandas

    with path.open("rb") as file:
        head = file.read(4)
    packed = next((name for magic, name in COMPRESSIONS.items() if head.startswith(magic)), None)
    given: Any = {"compression": packed, "encoding": "utf-8-sig", "encoding_errors": "replace"}
    try:
        # No cell holds a bell, so the header is one cell.
        header = pandas.read_csv(path, sep="\a", header=None, nrows=1, **given).iat[0, 0]
        delimiter = max(",;\t", key=header.count)
        columns = find_columns([name.strip('"') for name in header.split(delimiter)], str(path))
        with pandas.read_csv(
            path,
            sep=delimiter,
            usecols=list(columns.values()),
            chunksize=ROWS_AT_ONCE,
            on_bad_lines="skip",
            dtype={columns["time"]: str},
            **given,
        ) as chunks:
            return sort_fixes([clean(chunk, columns) for chunk in chunks])
    except ImportError:
        raise ConfigError(f"{path}: {missing_extra('zstandard', 'ais')}") from None
    except ConfigError:
        raise
    except Exception as error:
        # Packed files have errors of their own: BadZipFile, zlib.error, ZstdError.
        if packed is None and not isinstance(error, ValueError | EOFError | OSError):
            raise
        raise ConfigError(f"{path}: {error}") from None


def read_frame(frame: DataFrame) -> Fixes:
    """Read a DataFrame of AIS positions, with the columns that a table has.

    Raises:
        ConfigError: a column is missing.
    """
    columns = find_columns([str(name) for name in frame.columns], "the DataFrame")
    return sort_fixes([clean(frame, columns)])


def is_table(head: bytes) -> bool:
    """Return whether a file's first bytes are those of a table of AIS positions, or of a compressed file."""
    if head.startswith(tuple(COMPRESSIONS)):
        return True
    names = head.partition(b"\n")[0].decode("utf-8-sig", errors="replace").replace(";", ",").split(",")
    known = {simple(name) for name in names}
    return sum(not known.isdisjoint(aliases) for aliases in ALIASES.values()) >= 3


def simple(name: str) -> str:
    """Return a column's name as `ALIASES` has it."""
    return name.strip('"# \r').lower()


def find_columns(names: list[str], where: str) -> dict[str, str]:
    """Return the table's name of each of the six columns, and of the class if there is one.

    Raises:
        ConfigError: columns are missing.
    """
    by_name = {simple(name): name for name in reversed(names)}
    found = {
        kind: next((by_name[alias] for alias in aliases if alias in by_name), None)
        for kind, aliases in (*ALIASES.items(), ("class", CLASSES))
    }
    if missing := [kind for kind in ALIASES if found[kind] is None]:
        allowed = "; ".join(f"{kind}: {', '.join(ALIASES[kind])}" for kind in missing)
        raise ConfigError(f"{where}: has no column for {', '.join(missing)}; allowed names: {allowed}")
    return {kind: name for kind, name in found.items() if name is not None}


def clean(table: DataFrame, columns: dict[str, str]) -> Fixes:
    """Return the rows of a table that say where a ship was, in the table's order.

    Raises:
        ValueError: a time is none, or of another time zone than UTC, or latitudes lie beyond a pole.
    """
    if "class" in columns:
        classes = table[columns["class"]].astype(str).str.strip().str.lower()
        table = table[classes.isin(["a", "b", "class a", "class b"])]
    mmsi, latitude, longitude, sog, cog = (
        numbers(table[columns[kind]]) for kind in ("mmsi", "latitude", "longitude", "sog", "cog")
    )
    if (np.abs(latitude) > 91).sum() > len(table) / 2:
        raise ValueError("most latitudes lie beyond 90 degrees; are latitude and longitude swapped?")
    if simple(columns["time"]) == "basedatetime":
        # MarineCadastre's old courses are signed numbers of 12 bits: 345 degrees is listed as -64.6.
        cog = np.where(cog < 0, np.round(cog + 409.6, 1), cog)
    return known_fixes(mmsi, read_times(table[columns["time"]]), latitude, longitude, sog, cog)


def known_fixes(
    mmsi: NDArray[Any],
    time: NDArray[Any],
    latitude: NDArray[Any],
    longitude: NDArray[Any],
    knots: NDArray[Any],
    course: NDArray[Any],
) -> Fixes:
    """Return the rows of ships whose place is known; speeds and courses that are not available become NaN."""
    # The first digit of a ship's MMSI is 2 to 7; others are base stations, buoys and search and rescue.
    kept = (time > 0) & (
        (mmsi >= 200_000_000) & (mmsi < 800_000_000) & (np.abs(latitude) <= 85) & (np.abs(longitude) <= 180)
    )
    speed = np.where((knots >= 0) & (knots <= MAX_SPEED), knots * KNOT, np.nan)
    course = np.where((course >= 0) & (course < 360), course, np.nan)
    kinds = (np.int32, np.int64, np.float64, np.float64, np.float32, np.float32)
    columns = (mmsi, time, latitude, longitude, speed, course)
    return Fixes(*(column[kept].astype(kind) for column, kind in zip(columns, kinds, strict=True)))


def numbers(column: Any) -> NDArray[np.float64]:
    """Return a column as numbers, NaN where a cell is none."""
    import pandas

    values = pandas.to_numeric(column, errors="coerce")
    return np.array(values, dtype=np.float64)


def read_times(column: Any) -> NDArray[np.int64]:
    """Return times as seconds since 1970 (UTC), negative where there is none.

    Text is ISO 8601, or has the day first and slashes, as in Denmark's files.
    """
    import pandas

    if not pandas.api.types.is_datetime64_any_dtype(column):
        days_first = column.iloc[:1].astype(str).str.contains("/").any()
        form = "%d/%m/%Y %H:%M:%S" if days_first else "ISO8601"
        try:
            times = pandas.to_datetime(column, format=form)
        except ValueError as error:
            if "zone" in str(error):
                raise ValueError("time: has several time zones; allowed: UTC") from None
            wrong = column[pandas.to_datetime(column, format=form, errors="coerce").isna() & column.notna()]
            # The header is row 1.
            where = f"row {wrong.index[0] + 2}: got {wrong.iloc[0]!s:.40}" if len(wrong) else str(error)[:80]
            allowed = "2025-01-31T12:00:00, or Denmark's 31/01/2025 12:00:00"
            raise ValueError(f"time: {where}; allowed: {allowed}") from None
        column = times
    zone = getattr(column.dt, "tz", None)
    if zone is not None and str(zone) not in ("UTC", "UTC+00:00"):
        raise ValueError(f"time: has the time zone {zone}; allowed: UTC")
    return np.array(column.dt.tz_localize(None), dtype="datetime64[s]").astype(np.int64)


def sort_fixes(parts: list[Fixes]) -> Fixes:
    """Join, sort by ship and time, number the ships from 0, and keep the first fix of each second.

    Of the same second the fix with the least values is kept, so that the order of rows does not matter.
    """
    joined = [np.concatenate(columns) for columns in zip(*parts, strict=True)] if parts else []
    if not joined:
        return Fixes(
            *(np.empty(0, kind) for kind in (np.int32, np.int64, float, float, np.float32, np.float32))
        )
    order = np.lexsort([*(np.nan_to_num(joined[n], nan=1e9) for n in (5, 4, 3, 2)), joined[1], joined[0]])
    joined = [column[order] for column in joined]
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(joined[0]) != 0) | (np.diff(joined[1]) != 0)
    ships, *rest = (column[first] for column in joined)
    return Fixes(np.unique(ships, return_inverse=True)[1].astype(np.int32), *rest)


def read_nmea(path: Path) -> Fixes:
    """Read NMEA 0183 sentences of AIS, each with a tag block that says when it was received, by `pyais`.

    Raises:
        ConfigError: pyais is not installed, or no sentence has a time.
    """
    try:
        import pyais
    except ImportError:
        raise ConfigError(f"{path}: {missing_extra('pyais', 'ais')}") from None
    rows: list[tuple[float, ...]] = []
    untimed = 0
    with path.open("rb") as file:
        # A sentence whose checksum is wrong is decoded all the same.
        for message in (one for one in pyais.IterMessages(file) if one.is_valid):
            if (tags := message.tag_block) is not None:
                tags.init()
            # A tag block with a wrong checksum, or a word for a time, tells no time.
            if tags is None or not tags.is_valid or not str(tags.receiver_timestamp).isdecimal():
                untimed += 1
                continue
            time = int(tags.receiver_timestamp)
            # Receivers write seconds or milliseconds.
            rows.extend(decoded(message, time // 1000 if time > MAX_SECONDS else time))
    if not rows:
        sentences = f"{untimed} sentences have no time; wanted: tag blocks with c:SECONDS"
        raise ConfigError(
            f"{path}: {sentences if untimed else 'has no position report (1 to 3, 18, 19, 27)'}"
        )
    mmsi, time, latitude, longitude, sog, cog = np.array(sorted(rows)).T
    return sort_fixes([known_fixes(mmsi, time, latitude, longitude, sog, cog)])


def decoded(message: Any, time: int) -> Iterator[tuple[float, ...]]:
    """Yield a position report's MMSI, time, latitude, longitude, speed (knots) and course (degrees)."""
    import pyais

    try:
        report = message.decode()
    except pyais.exceptions.AISBaseException:
        return
    if report.msg_type not in (1, 2, 3, 18, 19, 27):
        return
    sog, cog = float(report.speed), float(report.course)
    if report.msg_type == 27:
        # A long-range report has sentinels of its own.
        sog, cog = (np.nan if sog >= 63 else sog), (np.nan if cog >= 511 else cog)
    yield float(report.mmsi), float(time), float(report.lat), float(report.lon), sog, cog
