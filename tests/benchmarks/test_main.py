"""The command: a part from arguments to file, what it refuses, and what it measures beside time."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from benchmarks import __main__ as command
from benchmarks import checkpoints, memory, simulator, work
from benchmarks.checkpoints import measure_checkpoints
from benchmarks.table import compare
from benchmarks.timing import measure
from ship_trl.config.types import BFLOAT16


@pytest.mark.long
@pytest.mark.precision
def test_memory_from_arguments_to_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(memory, "measure_run", lambda episodes: 1000 * episodes)
    command.main(["memory", "--json", str(tmp_path / "out.json")])
    assert "ours, states (scratch)" in capsys.readouterr().out
    states, features, _, pixels, _, run = [
        row["measured"]["values"][0] for row in json.loads((tmp_path / "out.json").read_text())["rows"]
    ]
    # A transition is two states of four float32; in pixels it is two pictures.
    assert 50_000 * 2 * 4 * 4 < states < features < pixels and 50 * states < pixels
    assert pixels > 2 * 50_000 * 84 * 84
    assert run == 1000 * memory.EPISODES


@pytest.mark.long
def test_a_run_fits_beside_others() -> None:
    # A study has one on each core.
    assert 2**27 < memory.measure_run(memory.EPISODES) < 1.2 * 2**30


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["nothing"],
            "benchmarks: no part nothing; allowed: loop, update, frozen, vector, simulator, memory, ",
        ),
        (["--rounds", "0"], "--rounds: must be at least 1, got 0"),
        (["--seconds", "0"], "--seconds: must be above 0, got 0.0"),
        (["--json", "/nowhere/at/all.json"], "--json: no folder /nowhere/at"),
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
    monkeypatch.setattr(work, "find_spec", lambda name: None)
    with pytest.raises(SystemExit):
        command.main(["memory"])
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "pip install -e '.[bench]'" in error


def test_bytes_are_counted_once() -> None:
    tensor = torch.zeros(10)

    class Holder:
        def __init__(self) -> None:
            self.parts = {"whole": tensor, "half": tensor[:5], "more": [np.zeros(3, np.uint8)]}
            self.me = self

    assert memory.held_bytes(Holder(), tensor) == 43


def test_checkpoints_are_written_and_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpoints, "ARMS", ("scratch", "FE4"))
    found = measure_checkpoints(2, 0.01, "learn.replay_size=100")
    groups = [one.group for one in found]
    assert groups == [name for name in ("write", "read", "2 on the disk") for _ in range(2)]
    assert all(value > 0 for one in found for value in one.values)
    assert [row.of_first is None for row in compare("checkpoints", found)] == 3 * [True, False]


def test_every_simulator_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulator, "BATCH_SIZES", (1, 16))
    found = measure(simulator.probes(), rounds=1, seconds=0.001)
    assert len(found) == 7 * len(simulator.CASES) + 5 and min(one.median for one in found) > 0
