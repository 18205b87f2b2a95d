"""Trainings side by side, counted together."""

import pytest

from ship_trl.bench import cores


def test_processes_train_at_once_and_are_added_up() -> None:
    assert cores.side_by_side(2, 0.2) > 10


def test_one_process_and_one_a_core_take_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def pretend(processes: int, seconds: float) -> float:
        asked.append((processes, seconds))
        return 100.0 * processes**0.9 + len(asked)

    monkeypatch.setattr(cores, "side_by_side", pretend)
    monkeypatch.setattr(cores, "cores", lambda: 3)
    rates = cores.growth_with_cores(2, 1.5)
    assert asked == [(1, 1.5), (3, 1.5)] * 2 and {k: len(v) for k, v in rates.items()} == {1: 2, 3: 2}


def test_gains_compare_within_a_round() -> None:
    # The machine is half as fast in the second round, which leaves ratios alone.
    assert cores.gains({1: [100.0, 50.0, 80.0], 2: [190.0, 95.0, 120.0]}) == {1: 1.0, 2: pytest.approx(1.9)}


def test_a_training_that_does_not_start_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores.sys, "executable", "/bin/false")
    with pytest.raises(RuntimeError, match="did not start"):
        cores.side_by_side(1, 0.1)
