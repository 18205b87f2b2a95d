"""The command in a process of its own, and what it refuses."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from ship_trl.bench import __main__ as command
from ship_trl.bench import parts
from ship_trl.bench.footprint import held_bytes, peak_bytes
from ship_trl.config.types import BFLOAT16

ROOT = Path(__file__).parents[2]


@pytest.mark.precision
def test_a_part_runs(tmp_path: Path) -> None:
    arguments = ["memory", "--json", "out.json", "--rounds", "1", "--seconds", "0.01"]
    done = subprocess.run(
        [sys.executable, "-m", "ship_trl.bench", *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "COLUMNS": "100"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert "GFLOP/s fp32" in done.stdout and "ours, states (scratch)" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 100
    machine, ours, _, features, pixels, _, run = map(
        json.loads, (tmp_path / "out.json").read_text().splitlines()
    )
    assert machine["fp32"] > 0
    assert features["median"] < pixels["median"]
    # What a run may take: a study has one on each core.
    assert 2**27 < run["median"] < 1.2 * 2**30
    assert pixels["median"] > 2 * 50_000 * 84 * 84 > 100 * ours["median"] > 100 * 50_000 * 2 * 4 * 4


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing"], "bench: no part nothing; allowed: simulator, replay, update, loop, frozen, memory"),
        (["--rounds", "0"], "--rounds: must be at least 1, got 0"),
        (["--seconds", "0"], "--seconds: must be above 0, got 0.0"),
        (["--json", "/nowhere/at/all.json"], "--json: no folder /nowhere/at"),
    ],
)
def test_wrong_input_is_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)
    error = capsys.readouterr().err
    assert ended.value.code == 1 and said in error and error.count("\n") == 1


def test_missing_library_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    with pytest.raises(SystemExit) as ended:
        command.main(["memory"])
    error = capsys.readouterr().err
    assert ended.value.code == 1 and error.count("\n") == 1
    assert "pip install 'ship_trl[bench]'" in error


def test_a_wrong_switch_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(BFLOAT16, "no")
    with pytest.raises(SystemExit) as ended:
        command.main(["memory"])
    assert ended.value.code == 1
    assert capsys.readouterr().err == "ship_trl: SHIP_TRL_BFLOAT16: must be on or off, got no\n"


def test_every_part_is_named() -> None:
    assert tuple(parts.PARTS) == command.PARTS


def test_bytes_are_counted_once() -> None:
    tensor = torch.zeros(10)

    class Holder:
        def __init__(self) -> None:
            self.parts = {"whole": tensor, "half": tensor[:5], "more": [np.zeros(3, np.uint8)]}
            self.me = self

    assert held_bytes(Holder()) == 43


def test_a_runs_memory_is_not_that_of_who_starts_it() -> None:
    ballast = np.ones(2**27)  # a gibibyte
    code = "print(1, flush=True); input()"
    child = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        # Until it is a Python of its own, it is a copy of this one.
        assert child.stdout is not None and child.stdout.readline()
        assert 2**20 < peak_bytes(child.pid) < 2**29 < ballast.nbytes
    finally:
        child.communicate(b"\n")
    assert peak_bytes(2**22 + 1) == 0
