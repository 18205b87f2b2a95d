"""Ratios, shares, and tables that fit."""

import dataclasses
import json

import pytest
from ship_trl.bench import report
from ship_trl.bench.machine import Machine
from ship_trl.bench.timing import Probe, Timing

MACHINE = Machine("a processor", 2, 1, "2", fp32=100.0, bf16=200.0, copy=10.0)


def timings() -> list[Timing]:
    run = lambda: 1  # noqa: E731
    return [
        Timing(Probe("ours", run, group="g", ours=True, flops=1e9, precision="bf16"), [40.0, 50.0, 60.0]),
        Timing(Probe("first", run, group="g", flops=1e9), [25.0]),
        Timing(Probe("second", run, group="g"), [100.0]),
        Timing(Probe("alone", run, group="h", ours=True), [1234.0]),
    ]


def test_rows_are_compared_within_their_group() -> None:
    ours, first, second, alone = report.rows("loop", timings(), MACHINE)
    assert (ours.of_peer, ours.ours_is, ours.of_peak) == (2.0, None, 0.25)
    assert (first.of_peer, first.ours_is, first.of_peak) == (1.0, 2.0, 0.25)
    assert (second.of_peer, second.ours_is, second.of_peak) == (4.0, 0.5, None)
    assert (alone.of_peer, alone.ours_is) == (None, None)
    assert json.loads(report.json_line(ours))["rates"] == [40.0, 50.0, 60.0]
    assert ours.cells() == ["g", "ours", "step", "50", "40..60", "2.00x", "", "25% bf16"]


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.1234, "0.123"), (12.34, "12.3"), (1234.0, "1.23k"), (999.9e3, "1000k"), (2e6, "2M")],
)
def test_numbers_are_short(value: float, text: str) -> None:
    assert report.number(value) == text


@pytest.mark.parametrize(("cores", "words"), [(1, ", 1 core, "), (2, ", 2 cores, ")])
def test_the_machine_is_named(cores: int, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    report.header(dataclasses.replace(MACHINE, cores=cores))
    assert words in capsys.readouterr().out


def test_markdown_leaves_out_empty_columns(capsys: pytest.CaptureFixture[str]) -> None:
    report.show("T", ("name", "x", "y"), [["a", "", "1"], ["b", "", "2"]], markdown=True)
    assert capsys.readouterr().out == "\nT\n\n| name | y |\n| --- | ---: |\n| a | 1 |\n| b | 2 |\n"
