"""AIS positions: whatever wrote them, the same fixes; what is not available is missing."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ship_trl.config.bounds import KNOT
from ship_trl.config.errors import ConfigError
from ship_trl.formats.ais import Fixes, read_frame, read_nmea, read_table
from tests.formats.traffic import (
    CROSSING,
    START,
    TABLES,
    danish,
    make,
    marinecadastre_new,
    marinecadastre_old,
    write,
)

ROWS = make(CROSSING, minutes=2)


def same(one: Fixes, other: Fixes) -> None:
    for name in Fixes._fields:
        left, right = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-5 if "itude" in name else 1e-3, err_msg=name)


@pytest.mark.parametrize("table", TABLES)
def test_every_source_gives_the_same_fixes(table: str, tmp_path: Path) -> None:
    fixes = read_table(write(tmp_path / "a.csv", ROWS, table))
    same(fixes, read_frame(ROWS.assign(time=pandas.to_datetime(ROWS.time, unit="s"))))
    assert fixes.ship.tolist() == [0] * 13 + [1] * 13
    assert fixes.time[:2].tolist() == [START, START + 10]
    np.testing.assert_allclose(fixes.speed, 12 * KNOT, rtol=1e-6)
    np.testing.assert_allclose(fixes.course, [0] * 13 + [270] * 13, atol=0.05)


def test_compressed_tables_are_told_by_their_content(tmp_path: Path) -> None:
    plain = write(tmp_path / "a.csv", ROWS, "danish")
    with zipfile.ZipFile(tmp_path / "b.csv", "w") as archive:
        archive.write(plain, "a.csv")
    same(read_table(tmp_path / "b.csv"), read_table(plain))


def test_zstandard_is_read(tmp_path: Path) -> None:
    zstandard = pytest.importorskip("zstandard", reason="zstandard is not installed")
    plain = write(tmp_path / "a.csv", ROWS, "marinecadastre_new")
    (tmp_path / "b.csv.zst").write_bytes(zstandard.ZstdCompressor().compress(plain.read_bytes()))
    same(read_table(tmp_path / "b.csv.zst"), read_table(plain))


@given(st.randoms(use_true_random=False))
@settings(max_examples=10)
def test_rows_in_any_order_give_the_same_fixes(random: Any) -> None:
    order = list(range(len(ROWS)))
    random.shuffle(order)
    table = danish(ROWS)
    same(read_frame(table.iloc[order]), read_frame(table))


# Nothing available, and what no message can hold; see docs/formats.md.
@pytest.mark.parametrize("value", [102.3, 102.2, 63.0, 1023, -0.1, None, "Unknown"])
def test_a_speed_that_is_none_is_missing(value: object) -> None:
    table = danish(ROWS).astype({"SOG": object})
    table.loc[0, "SOG"] = value
    speed = read_frame(table).speed
    assert np.isnan(speed[0]) and np.isfinite(speed[1:]).all()


@pytest.mark.parametrize("value", [360.0, 511, 409.5, -1.0, 3600, None, ""])
def test_a_course_that_is_none_is_missing(value: object) -> None:
    table = danish(ROWS).astype({"COG": object})
    table.loc[0, "COG"] = value
    course = read_frame(table).course
    assert np.isnan(course[0]) and np.isfinite(course[1:]).all()


@pytest.mark.parametrize(
    ("column", "value"), [("Latitude", 91.0), ("Longitude", 181.0), ("MMSI", 2190047), ("MMSI", 992191234)]
)
def test_a_row_without_a_place_or_a_ship_is_left_out(column: str, value: float) -> None:
    table = danish(ROWS)
    table.loc[0, column] = value
    assert len(read_frame(table).ship) == len(ROWS) - 1


def test_only_ships_with_class_a_or_b_are_kept() -> None:
    table = danish(ROWS)
    table.loc[table.MMSI == 219_000_001, "Type of mobile"] = "Base Station"
    assert len(read_frame(table).ship) == 13


def test_old_courses_that_wrapped_are_put_right_and_the_missing_one_is_missing() -> None:
    table = marinecadastre_old(ROWS)
    table.loc[0, "COG"], table.loc[1, "COG"] = -64.6, -49.6
    course = read_frame(table).course
    # Rows are sorted by ship: the first rows of both ships.
    assert course[0] == pytest.approx(345.0, abs=0.01) and np.isnan(course[13])
    new = marinecadastre_new(ROWS)
    new.loc[0, "cog"] = -64.6
    assert np.isnan(read_frame(new).course[0])


def test_of_one_second_one_fix_is_kept() -> None:
    assert len(read_frame(pandas.concat([danish(ROWS), danish(ROWS)])).ship) == len(ROWS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sog": "speed"}, "has no column for sog; allowed names: sog"),
        (
            {"base_date_time": "when", "cog": "track"},
            "has no column for time, cog; allowed names: time: basedatetime",
        ),
    ],
)
def test_missing_columns_are_named(change: dict[str, str], message: str, tmp_path: Path) -> None:
    marinecadastre_new(ROWS).rename(columns=change).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(ConfigError, match=message):
        read_table(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("base_date_time", "2025-06-01T00:00:00+02:00", "time: has the time zone UTC\\+02:00; allowed: UTC"),
        ("base_date_time", "yesterday", "time: .*yesterday"),
        ("latitude", 120.0, "are latitude and longitude swapped"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(
    column: str, value: object, message: str, tmp_path: Path
) -> None:
    table = marinecadastre_new(ROWS)
    table[column] = value
    table.to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(ConfigError, match=message) as caught:
        read_table(tmp_path / "a.csv")
    assert "\n" not in str(caught.value) and str(tmp_path / "a.csv") in str(caught.value)


@pytest.mark.parametrize("head", [b"PK\x03\x04", b"\x28\xb5\x2f\xfd"])
def test_a_broken_packed_table_is_refused(head: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(head + bytes(range(200)))
    with pytest.raises(ConfigError, match=r"a\.csv: "):
        read_table(path)


def nmea(rows: pandas.DataFrame, message: int) -> list[str]:
    pyais = pytest.importorskip("pyais", reason="pyais is not installed")
    sentences = []
    for row in rows.itertuples():
        fields = {
            "type": message,
            "mmsi": row.mmsi,
            "lat": row.lat,
            "lon": row.lon,
            "speed": row.sog,
            "course": row.cog,
        }
        (sentence,) = pyais.encode_dict(fields, talker_id="AI", radio_channel="A", sentence_type="VDM")
        sentences.append(tagged(sentence, row.time))
    return sentences


def tagged(sentence: str, seconds: int) -> str:
    block = f"c:{seconds}"
    check = 0
    for letter in block:
        check ^= ord(letter)
    return f"\\{block}*{check:02X}\\{sentence}"


@pytest.mark.parametrize("message", [1, 2, 3, 18, 19, 27])
def test_sentences_give_the_fixes_of_a_table(message: int, tmp_path: Path) -> None:
    rows = ROWS.assign(sog=12.0)
    (tmp_path / "a.nmea").write_text("\n".join(nmea(rows, message)) + "\n")
    found, wanted = read_nmea(tmp_path / "a.nmea"), read_frame(danish(rows))
    # A long-range report has tenths of minutes: 185 m.
    within = 2e-3 if message == 27 else 1e-5
    np.testing.assert_allclose(found.latitude, wanted.latitude, rtol=0, atol=within)
    np.testing.assert_array_equal(found.time, wanted.time)
    np.testing.assert_allclose(found.course, wanted.course, atol=1)
    np.testing.assert_allclose(found.speed, wanted.speed, atol=0.01)


def test_sentences_without_a_time_are_refused(tmp_path: Path) -> None:
    lines = [line.rpartition("\\")[2] for line in nmea(ROWS.iloc[:3], 1)]
    (tmp_path / "a.nmea").write_text("\n".join(lines) + "\n")
    with pytest.raises(ConfigError, match="3 sentences have no time; wanted: tag blocks"):
        read_nmea(tmp_path / "a.nmea")


def test_times_in_milliseconds_are_read_and_a_wrong_checksum_is_not(tmp_path: Path) -> None:
    right, other = (line.rpartition("\\")[2] for line in nmea(ROWS.iloc[:2], 1))
    damaged = other[:-2] + ("00" if other[-2:] != "00" else "01")
    (tmp_path / "a.nmea").write_text(f"{tagged(right, 1000 * START)}\n{tagged(damaged, START)}\n")
    # A word for a time, and a tag block whose checksum is wrong.
    word, wrong = tagged(right, 0).replace("c:0", "c:a"), tagged(right, START)[: -len(right) - 3]
    with (tmp_path / "a.nmea").open("a") as file:
        file.write(f"{word}\n{wrong}00\\{right}\n")
    fixes = read_nmea(tmp_path / "a.nmea")
    assert fixes.time.tolist() == [START] and fixes.ship.tolist() == [0]
