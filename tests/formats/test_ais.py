"""AIS positions: whatever wrote them, the same fixes; what is not available is missing."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ship_trl.config.bounds import KNOT
from ship_trl.config.errors import ConfigError
from ship_trl.formats import ais
from ship_trl.formats.ais import MAX_LINE, Fixes, read_table, sort_fixes, table_parts
from tests.formats.traffic import (
    CROSSING,
    START,
    TABLES,
    danish,
    make,
    marinecadastre_new,
    marinecadastre_old,
    read_frame,
    write,
)

ROWS = make(CROSSING, minutes=2)


def same(one: Fixes, other: Fixes) -> None:
    for name in Fixes._fields:
        left, right = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-5 if "itude" in name else 1e-3, err_msg=name)


@pytest.mark.parametrize("table", TABLES)
def test_every_source_gives_the_same_fixes(table: str, tmp_path: Path) -> None:
    fixes, wanted = read_table(write(tmp_path / "a.csv", ROWS, table)), ROWS.sort_values(["mmsi", "time"])
    np.testing.assert_allclose((fixes.latitude, fixes.longitude), (wanted.lat, wanted.lon), atol=1e-5)
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


@pytest.mark.parametrize("missing", [0, 1, 60])
def test_frames_are_read_to_their_ends_and_a_cut_one_is_refused(missing: int, tmp_path: Path) -> None:
    zstandard = pytest.importorskip("zstandard", reason="zstandard is not installed")
    plain = write(tmp_path / "a.csv", ROWS, "marinecadastre_new")
    text = plain.read_bytes()
    packed = b"".join(zstandard.ZstdCompressor().compress(part) for part in (text[:999], text[999:]))
    path = tmp_path / "b.csv.zst"
    # Between frames others may stand that readers skip.
    path.write_bytes(packed[: len(packed) - missing] + b"\x50\x2a\x4d\x18\x02\0\0\0ab" * (not missing))
    if not missing:
        same(read_table(path), read_table(plain))
        return
    with pytest.raises(ConfigError, match=r"b\.csv\.zst: is cut off; wanted: the whole file"):
        read_table(path)


@pytest.mark.parametrize("piece", [200, 1 << 24])
def test_a_quote_without_a_second_one_hides_no_rows(
    piece: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "a.csv", ROWS.assign(cog=ROWS.cog.round(1)), "marinecadastre_new")
    whole, lines = read_table(path), path.read_text().splitlines()
    for row, name in ((5, '"A'), (9, 'A"'), (12, '"A, B"'), (20, '"')):
        lines[row] = lines[row].replace(",A,0", f",{name},0")
    path.write_text("\n".join(lines))
    monkeypatch.setattr(ais, "PIECE", piece)
    same(read_table(path), whole)


@given(st.permutations(range(len(ROWS))), st.sampled_from(sorted(TABLES)))
@settings(max_examples=10)
def test_rows_in_any_order_give_the_same_fixes(order: list[int], kind: str) -> None:
    table = TABLES[kind][0](ROWS)
    # Some seconds twice, with other values.
    table = pandas.concat([table, table.iloc[:9].iloc[::-1].set_axis(table.index[:9])], ignore_index=True)
    shuffled = read_frame(table.iloc[[*order, *range(len(ROWS), len(table))][::-1]])
    for one, other in zip(shuffled, read_frame(table), strict=True):
        np.testing.assert_array_equal(one, other)


def test_lines_that_end_with_cr_and_lf_are_read_and_with_cr_alone_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", ROWS, "danish")
    whole, text = read_table(path), path.read_bytes()
    path.write_bytes(text.replace(b"\n", b"\r\n"))
    same(read_table(path), whole)
    path.write_bytes(text.replace(b"\n", b"\r"))
    with pytest.raises(ConfigError, match="its lines end with CR alone; allowed: LF, CR LF"):
        read_table(path)


@pytest.mark.parametrize("packed", [False, True])
def test_a_line_without_an_end_is_refused_by_its_number(packed: bool, tmp_path: Path) -> None:
    path, line = write(tmp_path / "a.csv", ROWS, "danish"), "a" * 10 * MAX_LINE
    path.write_text(f"{path.read_text()}{line}\n")
    if packed:
        with zipfile.ZipFile(tmp_path / "b.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(path, "a.csv")
        path = tmp_path / "b.zip"
    with pytest.raises(ConfigError) as caught:
        read_table(path)
    assert str(caught.value) == f"{path}: line {len(ROWS) + 2}: is too long; allowed: {MAX_LINE} bytes"


@pytest.mark.parametrize("piece", [50, 333])
def test_pieces_give_the_same_fixes_and_number_rows_alike(
    piece: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "a.csv", ROWS, "danish_old")
    whole = read_table(path)
    monkeypatch.setattr(ais, "PIECE", piece)
    same(read_table(path), whole)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:20], lines[20].replace("/2025 ", "/never "), *lines[21:]]))
    with pytest.raises(ConfigError, match="time: row 21: got 01/06/never"):
        read_table(path)


def test_a_packed_folder_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name in ("a.csv", "b.csv"):
            archive.writestr(name, "mmsi\n")
    with pytest.raises(ConfigError, match=r"a\.zip: holds 2 files; allowed: one table"):
        read_table(tmp_path / "a.zip")


# Nothing available, and what no message can hold, also as raw numbers: what docs/foreign.md tells of.
WORDS = [None, "", "Unknown", "Unknown value", "Undefined", "nan", "-"]
SPEEDS = [102.3, 102.2, 1023, 63.0, -0.1, *WORDS]
COURSES = [360.0, 3600, 511, 409.5, *WORDS]
PLACES = {"lat": [91.0, -91, 90.1, 181, 54_600_000, *WORDS], "lon": [181.0, -181, 181.5, 108_600_000, *WORDS]}
SHIPS = [2190047, 992191234, 0, 1_193_046_471, *WORDS]
SENTINELS = [
    *(("sog", value) for value in SPEEDS),
    *(("cog", value) for value in COURSES),
    *((column, value) for column, values in PLACES.items() for value in values),
    *(("mmsi", value) for value in SHIPS),
]


@given(st.sampled_from(sorted(TABLES)), st.sampled_from(SENTINELS), st.integers(0, len(ROWS) - 1))
@settings(max_examples=50)
def test_what_is_not_available_is_missing_in_every_table_and_row(
    kind: str, sentinel: tuple[str, object], row: int
) -> None:
    column, value = sentinel
    make_table, delimiter = TABLES[kind]
    whole = make_table(ROWS)
    table = whole.astype(object)
    # The tables' names of the columns begin alike.
    name = next(one for one in table.columns if one.lower().startswith(column))
    table.loc[row, name] = value
    wanted, found = read_frame(whole), read_frame(table)
    text = io.BytesIO(table.to_csv(index=False, sep=delimiter).encode())
    same(found, sort_fixes(table_parts(text, Path("a.csv"))))
    if column in ("sog", "cog"):
        one, other = (fixes.speed if column == "sog" else fixes.course for fixes in (found, wanted))
        (place,) = np.flatnonzero(np.isnan(one))
        assert len(one) == len(other) and np.array_equal(np.delete(one, place), np.delete(other, place))
        assert (found.time[place], found.ship[place]) == (ROWS.time[row], ROWS.mmsi[row] - ROWS.mmsi.min())
    else:
        assert len(found.ship) == len(wanted.ship) - 1
        assert np.count_nonzero(found.time == ROWS.time[row]) == 1


@given(st.sampled_from(["Heading", "ROT", "Navigational status"]), st.sampled_from([511, -128, 127, *WORDS]))
@settings(max_examples=10)
def test_other_columns_say_nothing(column: str, value: object) -> None:
    same(read_frame(danish(ROWS).assign(**{column: value})), read_frame(danish(ROWS)))


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


@given(st.integers(-2048, -1))
@settings(max_examples=30)
def test_every_old_course_below_zero_is_right_or_missing(tenths: int) -> None:
    table = marinecadastre_old(ROWS)
    table.loc[0, "COG"] = tenths / 10
    course, wanted = read_frame(table).course[0], (tenths + 4096) / 10
    assert np.isnan(course) if wanted >= 360 else course == pytest.approx(wanted, abs=1e-4)


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
