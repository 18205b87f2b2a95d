"""Probes take turns, and measurements are compared within their group."""

import json
from pathlib import Path

import pytest

from benchmarks import timing
from benchmarks.table import compare, print_table, short, write_json
from benchmarks.timing import Measurement, Probe, measure


def test_probes_take_turns_and_rates_are_units_by_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    now, order = 0.0, []

    def probe(name: str, count: int, takes: float) -> Probe:
        def run() -> None:
            nonlocal now
            now += takes
            order.append(name)

        return Probe("", name, run, count)

    monkeypatch.setattr(timing.time, "perf_counter", lambda: now)
    slow, fast = measure([probe("a", 3, 1.0), probe("b", 1, 0.25)], rounds=2, seconds=0.5)
    # Each once untimed. Then a once a round because it takes longer, and b until half a second has passed.
    assert order == ["a", "b", *["a", "b", "b"] * 2]
    assert slow.values == [3.0, 3.0] and fast.values == [4.0, 4.0] and fast.unit == "step/s"


def measured() -> list[Measurement]:
    return [
        # In the second round the machine was half as fast, which leaves ratios alone.
        Measurement("g", "peer", "step/s", [40.0, 20.0, 50.0]),
        Measurement("g", "ours", "step/s", [80.0, 40.0, 125.0], is_ours=True),
        Measurement("h", "other", "byte", [2e6]),
        Measurement("h", "another", "s", [0.5]),
    ]


def test_rows_are_compared_within_group_and_unit(tmp_path: Path) -> None:
    rows = compare("loop", measured())
    assert [row.of_first for row in rows] == [None, 2.0, None, None]
    assert [row.ours_is for row in rows] == [2.0, None, None, None]
    assert rows[0].cells() == ["g", "peer", "step/s", "40", "20..50", "", "2.00x"]
    write_json(tmp_path / "out.json", "a processor", rows)
    kept = json.loads((tmp_path / "out.json").read_text())
    assert kept["machine"] == "a processor"
    assert kept["rows"][0]["measured"]["values"] == [40.0, 20.0, 50.0]


@pytest.mark.parametrize(
    ("value", "text"), [(0.1234, "0.123"), (1234.0, "1.23k"), (999.9e3, "1000k"), (2e6, "2M"), (3e9, "3G")]
)
def test_numbers_are_short(value: float, text: str) -> None:
    assert short(value) == text


def test_markdown_has_a_line_a_row_and_no_empty_column(capsys: pytest.CaptureFixture[str]) -> None:
    print_table("Title", compare("memory", measured()[2:]), markdown=True)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    assert [line.count("|") for line in lines] == [5] * 4
    assert lines[2].replace(" ", "") == "|h|other|byte|2M|"
