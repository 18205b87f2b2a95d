"""The environment: outcomes of the bundled cases, ends of episodes, checks of TorchRL."""

import math
import pickle
from collections.abc import Callable

import pytest
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor
from torchrl.envs import EnvBase, TransformedEnv
from torchrl.envs.transforms import ActionMask
from torchrl.envs.utils import check_env_specs
from torchrl.modules import EGreedyModule, QValueModule

from ship_trl.config.types import Margin, World
from ship_trl.fast.worlds import make_env
from ship_trl.sim.cases import Case, load_case
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.state import STEP

CASES = ["1", "6"]
MakeCase = Callable[..., Case]


def repeat_action(env: ShipEnv, action: int, steps: int = 60) -> list[TensorDictBase]:
    """Repeat one action until the first ship's episode ends; return the steps."""
    episode: list[TensorDictBase] = []
    step = env.reset()
    while len(episode) < steps and not (episode and bool(step["done"][0])):
        step = env.step(step.set("action", torch.full(env.batch_size, action)))["next"]
        episode.append(step.clone())
    return episode


def ends(step: TensorDictBase) -> dict[str, bool]:
    return {key: bool(step[key][0]) for key in ("goal", "collision", "terminated", "truncated", "done")}


GOAL = {"goal": True, "collision": False, "terminated": True, "truncated": False, "done": True}
COLLISION = GOAL | {"goal": False, "collision": True}
TIMEOUT = {"goal": False, "collision": False, "terminated": False, "truncated": True, "done": True}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("pixels", [False, True])
def test_torchrl_accepts_it(name: str, pixels: bool, world: World) -> None:
    check_env_specs(make_env(load_case(name, world), world, 2, from_pixels=pixels, colour=name == "6"))


def test_torchrl_reads_its_mask(world: World) -> None:
    def mask(state: Tensor) -> Tensor:
        return torch.arange(7) != state[:, STEP, None] % 7

    env = make_env(load_case("4", world), world, 3, encoders={"action_mask": mask})
    check_env_specs(env)
    networks = TensorDictModule(lambda state: state[:, :7], in_keys=["state"], out_keys=["action_value"])
    rated = QValueModule("categorical", action_mask_key="action_mask")
    explores = EGreedyModule(env.action_spec, eps_init=0.5, action_mask_key="action_mask")
    masked = TransformedEnv(env, ActionMask())
    for policy in (
        None,
        TensorDictSequential(networks, rated),
        TensorDictSequential(networks, rated, explores),
    ):
        steps = masked.rollout(12, policy, break_when_any_done=False)
        taken = steps["action_mask"].gather(-1, steps["action"][..., None])
        assert bool(taken.all()) and not bool(steps["action_mask"].all())


@pytest.mark.parametrize(("name", "cpa"), [("1", math.inf), ("2", 106), ("new", 85)])
def test_keeping_course_reaches_the_goal(name: str, cpa: float, world: World) -> None:
    episode = repeat_action(make_env(load_case(name, world), world), 3)
    assert len(episode) == 36 and ends(episode[-1]) == GOAL
    assert not any(bool(step["done"]) for step in episode[:-1])
    assert sum(float(step["reward"]) for step in episode) == pytest.approx(83.9, abs=1e-3)
    assert float(episode[-1]["dcpa"]) == pytest.approx(cpa, abs=0.5)


@pytest.mark.parametrize("name", ["3", "4", "5", "6"])
def test_keeping_course_collides(name: str, world: World) -> None:
    episode = repeat_action(make_env(load_case(name, world), world), 3)
    assert len(episode) == 19 and ends(episode[-1]) == COLLISION
    assert float(episode[-1]["state"][0, 1]) == pytest.approx(285.0)
    assert float(episode[-1]["dcpa"]) < world.safe_distance < float(episode[-2]["dcpa"])


@pytest.mark.parametrize(
    ("name", "goal", "collision"),
    [
        ("1", 0.34, 0.00),
        ("4", 0.04, 0.71),
        ("6", 0.09, 0.63),
    ],
)
def test_outcome_rates_of_a_random_policy(name: str, goal: float, collision: float, world: World) -> None:
    count, generator = 4000, torch.Generator().manual_seed(0)
    env = make_env(load_case(name, world), world, count)
    step = env.reset()
    running = torch.ones(count, dtype=torch.bool)
    goals = collisions = 0
    for _ in range(60):
        step = env.step(step.set("action", torch.randint(7, (count,), generator=generator)))["next"]
        goals += int((running & step["goal"][:, 0]).sum())
        collisions += int((running & step["collision"][:, 0]).sum())
        running &= ~step["done"][:, 0]
    assert not bool(running.any())
    # Three standard errors of 4,000 episodes, and the table's rounding.
    assert goals / count == pytest.approx(goal, abs=0.03)
    assert collisions / count == pytest.approx(collision, abs=0.03)


def test_a_collision_takes_precedence_over_the_goal(world: World, make_case: MakeCase) -> None:
    # The ship is 42 m away when own ship comes within 60 m of the goal, and 54 m one step before.
    episode = repeat_action(make_env(make_case((30.0, 570.0, 0.0, 0.0)), world), 3)
    assert len(episode) == 36 and ends(episode[-1]) == COLLISION
    assert float(episode[-1]["reward"]) == pytest.approx(-200.6)


def test_a_fast_ship_collides_between_two_frames(world: World, make_case: MakeCase) -> None:
    # 150 m to port after one second, 150 m to starboard after two, across the bow in between.
    env = make_env(make_case((-450.0, 30.0, 0.0, 300.0)), world)
    episode = repeat_action(env, 3)
    assert len(episode) == 2 and ends(episode[-1]) == COLLISION
    assert float(episode[0]["dcpa"]) > 149 and float(episode[1]["dcpa"]) < 10


def test_stepping_and_resetting_equals_torchrls(world: World) -> None:
    env = make_env(load_case("4", world), world, 8, from_pixels=True)
    generator = torch.Generator().manual_seed(3)
    ours, stock = env.reset(), env.reset()
    ended = 0
    for _ in range(70):
        action = torch.randint(7, (8,), generator=generator)
        one, ours = env.step_and_maybe_reset(ours.set("action", action))
        other, stock = EnvBase.step_and_maybe_reset(env, stock.set("action", action.clone()))
        ended += int(one["next", "done"].sum())
        for left, right in ((one, other), (ours, stock)):
            # TorchRL also zeroes the action of the rows that are reset; a policy overwrites it.
            keys = set(right.keys(True, True)) - {"action"}
            assert keys <= set(left.keys(True, True))
            assert all(torch.equal(left[key], right[key]) for key in keys)
    assert ended > 8


def test_steps_do_not_share_memory(world: World) -> None:
    env = make_env(load_case("6", world), world, 2, from_pixels=True)
    step, steps, copies = env.reset(), [], []
    for action in (0, 3, 6, 3):
        step = env.step(step.set("action", torch.full((2,), action)))["next"]
        steps.append(step.select("state", "pixels", "dcpa", "reward", "done"))
        copies.append(steps[-1].clone())
    assert all(bool((one == copy).all()) for one, copy in zip(steps, copies, strict=True))
    for key in steps[0].keys():  # noqa: SIM118
        assert len({one[key].data_ptr() for one in steps}) == len(steps), key
    assert env.reset()["state"].data_ptr() != env.reset()["state"].data_ptr()


@pytest.mark.parametrize("fast", [True, False])
def test_it_can_be_pickled(fast: bool, world: World) -> None:
    env = make_env(load_case("4", world), world, fast=fast)
    assert torch.equal(pickle.loads(pickle.dumps(env)).reset()["state"], env.reset()["state"])


def test_a_margin_costs_near_passes_and_nothing_else(world: World) -> None:
    case = load_case("4", world)
    margin = Margin(distance=65.0, penalty=30.0, collision=50.0)
    plain, shaped = (repeat_action(make_env(case, world, margin=one), 3) for one in (None, margin))
    costs = [float(one["reward"] - other["reward"]) for one, other in zip(plain, shaped, strict=True)]
    assert all(torch.equal(one["state"], other["state"]) for one, other in zip(plain, shaped, strict=True))
    # The least distance so far is that of the step as long as the ships come nearer.
    for cost, step in zip(costs, shaped, strict=True):
        near = (65.0 - float(step["dcpa"])) / 20.0
        cost -= 50.0 * bool(step["collision"])
        assert cost == pytest.approx(30.0 * min(max(near, 0.0), 1.0), abs=1e-3)
    assert costs[0] == 0.0 and costs[-1] == 80.0


def test_a_timeout_costs_and_is_final_if_the_margin_says_so(world: World) -> None:
    # Own ship circles.
    case = Case([0, 0], 90, [0, 600], "straight", [], "own")
    plain, shaped = (
        repeat_action(make_env(case, world, margin=one), 0) for one in (None, Margin(timeout=40.0))
    )
    costs = [float(one["reward"] - other["reward"]) for one, other in zip(plain, shaped, strict=True)]
    assert costs == pytest.approx([0.0] * 59 + [40.0])
    for steps, is_final in ((plain, False), (shaped, True)):
        flags = [(bool(one["truncated"]), bool(one["terminated"])) for one in steps[-2:]]
        assert flags == [(False, False), (True, is_final)]
