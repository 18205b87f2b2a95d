"""AIS sentences: the fixes of a table with the same numbers; what is not available is missing."""

from __future__ import annotations

import tempfile
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ship_trl.config.errors import ConfigError
from ship_trl.formats.ais import MAX_LINE
from ship_trl.formats.nmea import read_nmea
from tests.formats.traffic import CROSSING, START, danish, make, read_frame

ROWS = make(CROSSING, minutes=2)


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
    return f"\\{block}*{checksum(block)}\\{sentence}"


def checksum(text: str) -> str:
    return f"{reduce(xor, text.encode()):02X}"


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


@given(
    st.sampled_from([1, 2, 3, 18, 19, 27]),
    st.sampled_from([("speed", 102.3), ("speed", 102.2), ("course", 360), ("lat", 91), ("lon", 181)]),
)
@settings(max_examples=20)
def test_what_a_sentence_has_not_is_missing(message: int, sentinel: tuple[str, float]) -> None:
    # A long-range report has whole knots and degrees, and sentinels of its own.
    column, value = sentinel
    if message == 27:
        value = {"speed": 63, "course": 511}.get(column, value)
    names = {"speed": "sog", "course": "cog"}
    table = ROWS.iloc[[0]].assign(**{names.get(column, column): float(value)})
    with tempfile.NamedTemporaryFile(suffix=".nmea") as file:
        file.write("\n".join(nmea(table, message)).encode())
        file.flush()
        fixes = read_nmea(Path(file.name))
    assert len(fixes.ship) == (column in names)
    if column in names:
        missing = fixes.speed if column == "speed" else fixes.course
        assert np.isnan(missing).all() and np.isfinite([fixes.speed, fixes.course]).sum() == 1


def test_a_sentence_without_an_end_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.nmea").write_text("\n".join([*nmea(ROWS.iloc[:3], 1), "a" * 10 * MAX_LINE]))
    with pytest.raises(ConfigError, match=f"line 4: is too long; allowed: {MAX_LINE} bytes"):
        read_nmea(tmp_path / "a.nmea")


def test_short_sentences_and_long_times_tell_nothing(tmp_path: Path) -> None:
    whole = nmea(ROWS.iloc[:1], 1)[0]
    payload = whole.split(",")[5]
    short = [f"!AIVDM,1,1,,A,{payload[:end]},0" for end in (7, 12, 17, 20, 21)]
    checked = [f"{line}*{checksum(line[1:])}" for line in short]
    long = tagged(whole.rpartition("\\")[2], 10**400)
    (tmp_path / "a.nmea").write_text("\n".join([*(tagged(line, START + 1) for line in checked), long, whole]))
    assert read_nmea(tmp_path / "a.nmea").time.tolist() == [START]


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
