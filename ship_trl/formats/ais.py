"""AIS positions: tables of MarineCadastre (old, new), Denmark and Kystverket; and a new table.

Of all columns six are read, by their names: see `ALIASES`. Every value that means "not available", or lies
outside what a message can hold, becomes missing (NaN) here and nowhere later. Rows may come in any order.
"""

from __future__ import annotations

import io
import zipfile  # noqa: TID251 (one file is opened, nothing is extracted)
from collections.abc import Iterable, Iterator, Sequence
from datetime import timedelta
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.bounds import KNOT
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.formats.situation import PLACE, START, Situation

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
NUMBERS = ("mmsi", "latitude", "longitude", "sog", "cog", "old cog")
# Where the column is there, only ships with a transceiver of class A or B are kept.
CLASSES = ("transceiverclass", "transceiver", "type of mobile")
SHIPS = ("a", "b", "class a", "class b")
# Bytes that are read at once, and bytes of a line.
PIECE, MAX_LINE = 1 << 24, 1 << 16
# Bytes of a zst file that are unpacked at once: at most 64 MB, as 4 bytes can stand for 128 kB.
PACKED = 1 << 11
# The year 5138. A larger number is a time in milliseconds.
MAX_SECONDS = 10**11
# Knots. Above, a message means "not available" (102.3), or "102.2 or more".
MAX_SPEED = 50.0
# Of what is written: seconds between rows, as class A sends them at most speeds; the ships' first number.
AIS_SECONDS, FIRST_MMSI = 10, 200_000_000
AIS_COLUMNS = (
    "mmsi,base_date_time,longitude,latitude,sog,cog,heading,vessel_name,imo,call_sign,vessel_type,status,"
    "length,width,draft,cargo,transceiver"
)
ZIP, ZSTD = b"PK\x03\x04", b"\x28\xb5\x2f\xfd"


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

    def at(self, rows: NDArray[np.uint32] | slice) -> Fixes:
        """Return some rows."""
        ship, time, latitude, longitude, speed, course = self
        return Fixes(ship[rows], time[rows], latitude[rows], longitude[rows], speed[rows], course[rows])


KINDS: tuple[Any, ...] = (np.int32, np.int64, np.float64, np.float64, np.float32, np.float32)


def read_table(path: Path) -> Fixes:
    """Read a table of AIS positions, plain or compressed (zip, zst), in pieces: 36 bytes a row are kept.

    Raises:
        ConfigError: the file is no such table; it names the columns that are missing.
    """
    head = b""
    try:
        with path.open("rb") as file:
            head = file.read(4)
            file.seek(0)
            return sort_fixes(table_parts(unpacked(file, head), path))
    except ImportError:
        raise ConfigError(f"{path}: {missing_extra('zstandard', 'ais')}") from None
    except ConfigError:
        raise
    except Exception as error:
        # Packed files have errors of their own: BadZipFile, zlib.error, ZstdError.
        if head not in (ZIP, ZSTD) and not isinstance(error, ValueError | EOFError | OSError):
            raise
        raise ConfigError(f"{path}: {error}") from None


def unpacked(file: IO[bytes], head: bytes) -> IO[bytes]:
    """Return a file as it is, or what a compressed one holds."""
    if head == ZIP:
        archive = zipfile.ZipFile(file)
        if len(names := archive.namelist()) != 1:
            raise ValueError(f"holds {len(names)} files; allowed: one table")
        return archive.open(names[0])
    if head == ZSTD:
        return io.BufferedReader(Frames(file))
    return file


class Frames(io.RawIOBase):
    """What the frames of a zst file hold; `zstandard.stream_reader` does not say that a file is cut off."""

    def __init__(self, file: IO[bytes]) -> None:
        from zstandard import ZstdDecompressor

        self._file, self._unpacker = file, ZstdDecompressor()
        self._frame: Any = None
        self._packed = self._found = b""

    def readable(self) -> bool:
        """Return whether the file can be read: always."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer; return how many bytes were written, 0 at the end.

        Raises:
            EOFError: the last frame has no end.
        """
        while not self._found:
            packed = self._packed or self._file.read(PACKED)
            if not packed:
                if self._frame is not None:
                    raise EOFError("is cut off; wanted: the whole file")
                return 0
            self._frame = self._frame or self._unpacker.decompressobj()
            self._found, self._packed = self._frame.decompress(packed), b""
            if self._frame.eof:
                self._packed, self._frame = self._frame.unused_data, None
        part = self._found[: len(buffer)]
        buffer[: len(part)] = part
        self._found = self._found[len(part) :]
        return len(part)


def whole_lines(file: IO[bytes], path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield a file in pieces of whole lines, each with the number of its first line, from 1.

    Raises:
        ConfigError: a line is longer than `MAX_LINE` bytes.
    """
    number = 1
    while piece := file.read(PIECE):
        piece += file.readline(MAX_LINE + 1)
        ends = np.flatnonzero(np.frombuffer(piece, np.uint8) == ord("\n"))
        lengths = np.diff(ends, prepend=-1, append=len(piece))
        if lengths.max() > MAX_LINE + 1:
            line = number + int(np.argmax(lengths > MAX_LINE + 1))
            raise ConfigError(f"{path}: line {line}: is too long; allowed: {MAX_LINE} bytes")
        yield number, piece
        number += len(ends)


def table_parts(file: IO[bytes], path: Path) -> Iterator[Fixes]:
    """Yield the cleaned rows of a table, piece by piece."""
    import pandas

    kinds: dict[int, str] = {}
    for number, piece in whole_lines(file, path):
        first, rows = number, piece
        if not kinds:
            heading, _, rows = piece.partition(b"\n")
            header = heading.decode("utf-8-sig", errors="replace").rstrip("\r")
            if "\r" in header:
                raise ConfigError(f"{path}: its lines end with CR alone; allowed: LF, CR LF")
            delimiter, first = max(",;\t", key=header.count), 2
            names = header.split(delimiter)
            kinds = find_columns(names, str(path))
        if not rows.strip():
            continue
        if b'"' in rows:
            # A quote without a second one in its line, as in a ship's name, would hide the lines that follow.
            lines = rows.split(b"\n")
            rows = b"\n".join(one.replace(b'"', b"") if one.count(b'"') % 2 else one for one in lines)
        table = pandas.read_csv(
            io.BytesIO(rows),
            sep=delimiter,
            header=None,
            names=range(len(names)),
            usecols=list(kinds),
            index_col=False,
            on_bad_lines="skip",
            dtype={place: "category" for place, kind in kinds.items() if kind not in NUMBERS},
            encoding_errors="replace",
            low_memory=False,
        )
        yield clean(table.rename(columns=kinds), first)
    if not kinds:
        raise ConfigError(f"{path}: is empty; allowed: a table of AIS positions")


def find_columns(names: Sequence[str], where: str) -> dict[int, str]:
    """Return the kinds of columns by their places: the six, the class if there is one, and old courses.

    Raises:
        ConfigError: columns are missing.
    """
    known = [name.strip('"# \r').lower() for name in names]
    places = {
        kind: next((known.index(alias) for alias in aliases if alias in known), None)
        for kind, aliases in (*ALIASES.items(), ("class", CLASSES))
    }
    if missing := [kind for kind in ALIASES if places[kind] is None]:
        allowed = "; ".join(f"{kind}: {', '.join(ALIASES[kind])}" for kind in missing)
        raise ConfigError(f"{where}: has no column for {', '.join(missing)}; allowed names: {allowed}")
    if "basedatetime" in known:
        places["old cog"] = places.pop("cog")
    return {place: kind for kind, place in places.items() if place is not None}


def clean(table: DataFrame, first: int) -> Fixes:
    """Return the rows of a table that say where a ship was, in the table's order.

    `first` is the number of the first row in its file; columns have the names of `find_columns`.

    Raises:
        ValueError: a time is none, or of another time zone than UTC, or latitudes lie beyond a pole.
    """
    import pandas

    mmsi, latitude, longitude, sog, cog = (
        np.array(pandas.to_numeric(table[kind], errors="coerce"), dtype=np.float64)
        for kind in NUMBERS
        if kind in table
    )
    if (np.abs(latitude) > 91).sum() > len(table) / 2:
        raise ValueError("most latitudes lie beyond 90 degrees; are latitude and longitude swapped?")
    if "old cog" in table:
        # MarineCadastre's old courses are signed numbers of 12 bits: 345 degrees is listed as -64.6.
        cog = np.where(cog < 0, np.round(cog + 409.6, 1), cog)
    if "class" in table:
        classes = table["class"].astype("category").cat
        is_ship = [str(one).strip().lower() in SHIPS for one in classes.categories]
        mmsi[~np.append(is_ship, False).astype(bool)[classes.codes]] = np.nan
    return known_fixes(mmsi, read_times(table["time"], first), latitude, longitude, sog, cog)


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
    kept = ((time > 0) & (time < MAX_SECONDS)) & (
        (mmsi >= 200_000_000) & (mmsi < 800_000_000) & (np.abs(latitude) <= 85) & (np.abs(longitude) <= 180)
    )
    speed = np.where((knots >= 0) & (knots <= MAX_SPEED), knots * KNOT, np.nan)
    course = np.where((course >= 0) & (course < 360), course, np.nan)
    columns = (mmsi, time, latitude, longitude, speed, course)
    return Fixes(*(column[kept].astype(kind) for column, kind in zip(columns, KINDS, strict=True)))


def read_times(column: Any, first: int) -> NDArray[np.int64]:
    """Return times as seconds since 1970 (UTC), negative where there is none; `first` numbers the first row.

    Text is ISO 8601, or has the day first and slashes, as in Denmark's files.
    """
    import pandas

    # The same second stands in many rows.
    cells = column.astype("category").cat
    texts, codes = cells.categories.astype(str), np.asarray(cells.codes)
    form = "%d/%m/%Y %H:%M:%S" if texts.str.contains("/").any() else "ISO8601"
    try:
        times = pandas.to_datetime(texts, format=form)
    except ValueError as error:
        if "zone" in str(error):
            raise ValueError("time: has several time zones; allowed: UTC") from None
        is_none = pandas.to_datetime(texts, format=form, errors="coerce").isna()
        row = int(np.argmax(np.append(is_none, False)[codes]))
        got, allowed = f"{column.iloc[row]!s:.40}", "2025-01-31T12:00:00, or Denmark's 31/01/2025 12:00:00"
        raise ValueError(f"time: row {first + row}: got {got}; allowed: {allowed}") from None
    if str(times.tz) not in ("None", "UTC", "UTC+00:00"):
        raise ValueError(f"time: has the time zone {times.tz}; allowed: UTC")
    seconds = np.array(times.tz_localize(None), dtype="datetime64[s]").astype(np.int64)
    return np.append(seconds, -1)[codes]


def sort_fixes(parts: Iterable[Fixes]) -> Fixes:
    """Join, sort by ship and time, number the ships from 0, and keep the first fix of each second.

    Of the same second the fix with the least values is kept, so that the order of rows does not matter.
    """
    nothing = Fixes(*(np.empty(0, kind) for kind in KINDS))
    rows = [list(part) for part in (nothing, *parts)]
    # Column by column, so that the parts and what is joined are not held both.
    columns = [np.concatenate([row.pop() for row in rows]) for _ in KINDS][::-1]
    order = np.lexsort((columns[1], columns[0]))
    again = np.ones(max(0, len(order) - 1), bool)
    for column in columns[:2]:
        again &= np.diff(column[order]) == 0
    if again.any():
        doubled = np.append(again, False) | np.append(False, again)
        few = [np.nan_to_num(column[order[doubled]], nan=1e9) for column in columns]
        order[doubled] = order[doubled][np.lexsort([few[n] for n in (5, 4, 3, 2, 1, 0)])]
        order = order[np.append(True, ~again)]
    for n in range(len(columns)):
        columns[n] = columns[n][order]
    columns[0] = np.cumsum(np.diff(columns[0], prepend=columns[0][:1]) != 0, dtype=np.int32)
    return Fixes(*columns)


def write_ais(situation: Situation) -> str:
    """Return the tracks of a situation as a table like the new ones of MarineCadastre, sorted by time.

    Ships are numbered, own ship is 1: no name, call sign or MMSI of a real ship is written.
    """
    plane, start = situation.origin or PLACE, situation.start or START
    rows = []
    for number, ship in enumerate((situation.own, *situation.targets), 1):
        assert ship.track is not None
        seconds, x, y = ship.track.T
        # Whole seconds, as stamps have; a ship keeps its course within a step.
        times = np.arange(0, int(seconds[-1]) + 1, AIS_SECONDS)
        steps = np.searchsorted(seconds, times, side="right").clip(max=len(seconds) - 1) - 1
        latitudes, longitudes = plane.to_degrees(np.interp(times, seconds, x), np.interp(times, seconds, y))
        speeds = np.hypot(np.diff(x), np.diff(y)) / np.diff(seconds) / KNOT
        courses = np.degrees(np.arctan2(np.diff(x), np.diff(y))).round(1) % 360.0
        for second, latitude, longitude, step in zip(
            times.tolist(), latitudes, longitudes, steps, strict=True
        ):
            stamp = (start + timedelta(seconds=second)).strftime("%Y-%m-%d %H:%M:%S")
            place = f"{longitude:.6f},{latitude:.6f},{speeds[step]:.1f},{courses[step]:.1f}"
            rows.append((second, number, f"{FIRST_MMSI + number},{stamp},{place},,,,,,0,,,,,A"))
    return "\n".join((AIS_COLUMNS, *(row for _, _, row in sorted(rows)), ""))
