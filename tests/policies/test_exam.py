"""The exam: scenes of one target ship by course, speed, TCPA and DCPA, and how a policy's episodes end."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_starts
from ship_trl.learn.rollout import rollout
from ship_trl.policies import exam
from ship_trl.policies.named import make_policy
from ship_trl.policies.registry import Entry
from ship_trl.sim.cases import load_suite
from ship_trl.sim.encounter import relative_motion
from ship_trl.sim.state import SHIP_SPEED, relative_positions, target_ships


def entry(policy: str, world: World) -> Entry:
    return Entry(policy, policy, load_suite("traffic_near", world), world, False)


def some_states(world: World, count: int, ships: int = 1) -> Tensor:
    suite = exam.with_ships(load_suite("traffic_near", world), ships)
    return make_starts(suite, world).sample(count, torch.Generator().manual_seed(0))


def test_four_numbers_place_a_ship(world: World) -> None:
    states = some_states(world, 2)
    # From ahead, which own ship passes on either side; both after 20 s.
    numbers = np.array([[[math.pi, 10.0, 20.0, 30.0]], [[math.pi, 10.0, 20.0, -30.0]]])
    exam.place_ships(states, numbers)
    assert relative_positions(states)[:, 0].tolist() == pytest.approx(
        np.array([[30, 500], [-30, 500]]), abs=1e-3
    )
    motion = relative_motion(states.double())
    assert motion.dcpa.tolist() == [[pytest.approx(30)]] * 2
    assert motion.tcpa.tolist() == [[pytest.approx(20)]] * 2
    drawn = some_states(world, 50, ships=3)
    again = drawn.clone()
    exam.place_ships(again, exam.read_ships(drawn))
    torch.testing.assert_close(again, drawn, atol=1e-3, rtol=0)


def test_the_scenes_keep_the_bounds_and_say_what_can_be_solved(world: World) -> None:
    states, scenes = exam.draw_exam(load_suite("traffic_near", world), world, 3000)
    assert len(states) == len(scenes) == 3000
    assert scenes["range"].between(50, 650).all() and set(scenes["bearing"]) <= set(range(0, 360, 15))
    assert set(scenes["speed"]) == {"0.5 to 0.8", "0.8 to 1.2", "1.2 to 1.5"}
    assert set(scenes["encounter"]) == {"head-on", "give way", "stand on", "overtaking", "overtaken"}
    ahead = scenes[(scenes["bearing"] == 0) & (scenes["course"] == 180)]
    assert len(ahead) and (ahead["encounter"] != "overtaking").all()
    speed, distance = target_ships(states)[:, 0, SHIP_SPEED], relative_positions(states)[:, 0].norm(dim=-1)
    assert speed.min() >= 7.5 and speed.max() <= 22.5 and distance.min() >= 54 and distance.max() <= 640
    assert (relative_motion(states).dcpa <= 45.01).all()
    solvable = scenes["is_solvable"].to_numpy(copy=True)
    assert 0 < (~solvable).sum() < 60
    # A shield finds the manoeuvre, and there is none where the exam says so.
    some = torch.cat((states[solvable][:100], states[~solvable]))
    ends = exam.run_scenes(entry("keep_course+shield", world), some)
    assert ends.goal[:100].all() and not ends.goal[100:].any()
    # The first scenes of a larger exam are those of a smaller one.
    assert torch.equal(exam.draw_exam(load_suite("traffic_near", world), world, 100)[0], states[:100])


@pytest.mark.parametrize("policy", ["vo", "keep_course", "keep_course+shield"])
def test_the_episodes_end_as_in_evaluations(
    policy: str, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = some_states(world, 40, ships=2)
    env, loaded = make_policy(entry(policy, world), states, 0)
    episodes = rollout(env, loaded)
    # Rows take one scene after the other.
    monkeypatch.setattr(exam, "BATCH", 7)
    shares = list[float]()
    ends = exam.run_scenes(entry(policy, world), states, show=shares.append)
    assert ends.goal.tolist() == [one.goal for one in episodes]
    assert ends.collision.tolist() == [one.collision for one in episodes]
    assert (ends.margin[~ends.goal] <= 0).all() and (ends.margin[ends.goal] >= 0).all()
    clear = [min((one.dcpa - 45) / 45, (60 - one.length) / 60) for one in episodes]
    assert ends.margin == pytest.approx(clear, abs=1e-5)
    assert shares == sorted(shares) and shares[-1] == 1.0
