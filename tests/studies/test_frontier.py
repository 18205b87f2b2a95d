"""Studies of weights and parts: they train each run by one command and measure each policy."""

import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pandas as pd
import pytest

from studies import frontier, worth


@pytest.mark.parametrize(("study", "folders"), [(frontier, frontier.WEIGHTS), (worth, worth.PARTS)])
def test_each_run_is_a_command_and_each_policy_a_row(
    study: ModuleType, folders: tuple[object, ...], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    commands, measured = [], []

    def measure(policy: str) -> dict[str, float]:
        measured.append(policy)
        return {"traffic_test": 0.9, "obeys": 0.8}

    def run(command: list[str], **_: object) -> SimpleNamespace:
        commands.append(command)
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(study, "measure", measure)
    monkeypatch.setattr(sys, "argv", ["study", str(tmp_path)])
    study.main()
    assert [command[:3] for command in commands] == [[sys.executable, "-m", "ship_trl"]] * len(folders)
    assert [command[-1] for command in commands] == [f"output={tmp_path / str(one)}" for one in folders]
    (table,) = tmp_path.glob("*.csv")
    assert len(pd.read_csv(table)) == len(measured) >= len(commands)
    # Runs differ: each row is of another training, or of another mask.
    assert len(set(measured)) == len(measured) and len({tuple(one[:-1]) for one in commands}) == len(commands)


def test_a_failing_run_ends_the_study(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=3))
    with pytest.raises(SystemExit) as ended:
        frontier.train({tmp_path / "one": ()})
    assert ended.value.code == 3


def test_a_policy_is_measured_on_three_suites() -> None:
    row = frontier.measure("keep_course")
    # Whoever keeps course collides in traffic_test, and obeys in none of its encounters.
    assert row["traffic_test"] < 0.1 < row["traffic_reacting"] and row["obeys"] < 0.1
    assert set(row) == {*frontier.SUITES, "obeys", *(f"R{rule}" for rule in frontier.RULES)}
