"""The curves of learners over minutes: from the command to its files, and what the peers are given."""

import csv
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from tensordict import TensorDictBase

from benchmarks import __main__ as command
from benchmarks import curves
from benchmarks.curves import Curve, ShipVecEnv
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.gym import ShipCollisionVectorEnv
from ship_trl.learn.rollout import Episode, Policy, rollout
from ship_trl.sim.cases import load_suite
from ship_trl.sim.env import ShipEnv


@pytest.mark.long
def test_from_the_command_to_table_and_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(curves, "TEST_SUITE", "imazu")
    command.main(["curves", "--minutes", "0.005", "--seeds", "3"])
    with Path("outputs/curves.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["learner"], row["seed"]) for row in rows] == [
        (name, "3") for name in ("ours", "SB3 DQN", "SB3 PPO") for _ in range(2)
    ]
    for first, last in zip(rows[::2], rows[1::2], strict=True):
        assert float(first["minutes"]) < 0.005 <= float(last["minutes"])
        assert int(first["steps"]) < int(last["steps"]) and 0 <= float(last["success"]) <= 1
    with Image.open("outputs/curves.png") as picture:
        assert picture.size == (1200, 750)
    assert "not reached" in capsys.readouterr().out


def turn_always(step: TensorDictBase) -> TensorDictBase:
    return step.set("action", torch.zeros(step.batch_size, dtype=torch.int64))


def test_evaluations_are_due_by_training_time_alone(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = 0.0
    monkeypatch.setattr(time, "process_time", lambda: seconds)

    def slow(env: ShipEnv, policy: Policy) -> list[Episode]:
        nonlocal seconds
        seconds += 1000.0
        return rollout(env, policy)

    monkeypatch.setattr(curves, "rollout", slow)
    env = make_env(load_suite("4", world), world)
    policy, told = turn_always, list[bool]()
    curve = Curve("ours", 0, 1.0, env)
    for _ in range(7):
        told.append(curve.record(policy, len(told), False))
        seconds += 10.0
    assert [round(minutes, 3) for minutes, _, _ in curve.points] == [0.0, 0.5, 1.0]
    assert told == [True] * 6 + [False]
    # A training that ends earlier has a last point.
    early = Curve("ours", 0, 1.0, env)
    assert not early.record(policy, 8, True) and early.points[0][1] == 8
    early.points = [(n / 2, n, share) for n, share in enumerate((0.1, 0.92, 0.8))]
    assert early.minutes_to(0.9) == 0.5 and early.minutes_to(0.95) is None


def test_peers_are_told_of_the_last_observation_and_of_timeouts() -> None:
    make = lambda: ShipCollisionVectorEnv(8, "traffic_near", observation="vector")  # noqa: E731
    theirs, ours = ShipVecEnv(make()), make()
    theirs.seed(5)
    np.testing.assert_array_equal(np.asarray(theirs.reset()), ours.reset(seed=5)[0])
    draws, ended, timeouts = np.random.default_rng(2), 0, 0
    for _ in range(200):
        # Half of the ships circle until the step limit.
        actions = np.where(np.arange(8) < 4, 0, draws.integers(7, size=8))
        seen, rewards, over, told = theirs.step(actions)
        wanted, paid, terminated, truncated, infos = ours.step(actions)
        assert np.array_equal(np.asarray(seen), wanted) and np.array_equal(rewards, paid)
        assert np.array_equal(over, terminated | truncated)
        for row, one in enumerate(told):
            assert set(one) == ({"terminal_observation", "TimeLimit.truncated"} if over[row] else set())
            if over[row]:
                assert np.array_equal(one["terminal_observation"], infos["final_obs"][row])
                assert one["TimeLimit.truncated"] == truncated[row]
        ended, timeouts = ended + int(over.sum()), timeouts + int(truncated.sum())
    assert ended > timeouts > 0
