"""The command: what it refuses, that probes take turns, and what is measured beside time."""

import numpy as np
import pytest
import torch

from benchmarks import __main__ as command
from benchmarks import simulator, sizes, timing
from benchmarks.timing import Measurement, Probe, measure, print_table, short
from ship_trl.config.types import BFLOAT16


@pytest.mark.long
def test_memory_from_arguments_to_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found: list[Measurement] = []
    monkeypatch.setattr(timing, "print_table", lambda _, measured, __: found.extend(measured))
    command.main(["memory"])
    states, features, _, pixels, _, run = (one.values[0] for one in found)
    # A transition is two states of four float32; in pixels it is two pictures.
    assert 50_000 * 2 * 4 * 4 < states < features < pixels and 50 * states < pixels
    assert pixels > 2 * 50_000 * 84 * 84
    # A study has a run on each core.
    assert 2**27 < run < 1.2 * 2**30


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["nothing"],
            "benchmarks: no part nothing; allowed: loop, update, frozen,",
        ),
        (["--rounds", "0"], "--rounds: must be "),
        (["--device", "cuda", "memory"], "no part memory; allowed: simulator, update, loop, lockstep"),
        (["curves", "--minutes", "0"], "--minutes: must be "),
        (["curves", "--seeds", "0", "-1"], "--seeds: must be "),
    ],
)
def test_wrong_input_is_one_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)
    error = capsys.readouterr().err
    assert ended.value.code == 1 and message in error and error.count("\n") == 1


def test_a_missing_library_or_a_wrong_switch_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(BFLOAT16, "no")
    with pytest.raises(SystemExit):
        command.main(["memory"])
    assert capsys.readouterr().err == "ship_trl: SHIP_TRL_BFLOAT16: must be on or off, got no\n"
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    with pytest.raises(SystemExit):
        command.main(["memory"])
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "pip install -e '.[bench]'" in error


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


def test_rows_are_compared_within_group_and_unit(capsys: pytest.CaptureFixture[str]) -> None:
    measured = [
        # In the second round the machine was half as fast, which leaves ratios alone.
        Measurement("g", "peer", "step/s", [40.0, 20.0, 50.0]),
        Measurement("g", "ours", "step/s", [80.0, 40.0, 125.0], is_ours=True),
        Measurement("h", "other", "byte", [2e6]),
    ]
    print_table("Title", measured, markdown=True)
    lines = [line.replace(" ", "") for line in capsys.readouterr().out.splitlines() if "|" in line]
    assert lines[2:] == [
        "|g|peer|step/s|40|20..50||2.00x|",
        "|g|ours|step/s|80|40..125|2.00x||",
        "|h|other|byte|2M||||",
    ]
    print_table("Title", measured[2:], markdown=True)
    assert "| group | name | unit | median |\n" in capsys.readouterr().out
    assert [short(value) for value in (0.1234, 1234.0, 999.9e3, 3e9)] == ["0.123", "1.23k", "1000k", "3G"]


def test_bytes_are_counted_once() -> None:
    tensor = torch.zeros(10)

    class Holder:
        def __init__(self) -> None:
            self.parts = {"whole": tensor, "half": tensor[:5], "more": [np.zeros(3, np.uint8)]}
            self.me = self

    assert sizes.held_bytes(Holder(), tensor) == 43


def test_checkpoints_are_written_and_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sizes, "SAVED_ARMS", ("FE4",))
    found = sizes.measure_checkpoints(2, 0.01, "learn.replay_size=100", "learn.batch_size=8")
    assert [one.group for one in found] == ["write", "read", "2 on the disk"]
    assert all(value > 0 for one in found for value in one.values)


def test_every_simulator_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulator, "BATCH_SIZES", (1, 16))
    found = measure(simulator.probes(), rounds=1, seconds=0.001)
    assert len(found) == 7 * len(simulator.CASES) + 5 and all(one.values[0] > 0 for one in found)
