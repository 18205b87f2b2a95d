"""The planners reach the goal in the paper's cases and in the Imazu problems, and keep no memory too long."""

import pytest
import torch
from tensordict import TensorDict

from ship_trl.fast.worlds import make_env
from ship_trl.learn.rollout import Policy, rollout
from ship_trl.policies.named import load_policy
from ship_trl.sim.cases import Case, load_case, load_suite, load_world
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import Transition

WORLD = load_world()
PAPER = [load_case(name, WORLD) for name in ("1", "2", "3", "4", "5", "6", "new")]
IMAZU = list(load_suite("imazu", WORLD).cases)
PLANNERS = "vo", "sb_mpc", "apf"


def make(name: str, count: int) -> Policy:
    return load_policy(name, make_env(PAPER[0], WORLD, count))


def initial_states(cases: list[Case]) -> torch.Tensor:
    return torch.stack([initial_state(case, WORLD, 3) for case in cases])


def successes(name: str, cases: list[Case]) -> list[bool]:
    """Roll out each case in one row of a batch; return which reach the goal without a collision."""
    state = initial_states(cases)
    policy, transition = make(name, len(cases)), Transition(WORLD)
    reached = ended = torch.zeros(len(cases), dtype=torch.bool)
    for _ in range(WORLD.max_steps):
        step = TensorDict({"state": state}, batch_size=[len(cases)])
        after = transition(state, policy(step)["action"])
        reached = reached | (after.goal & ~ended)
        ended = ended | after.goal | after.collision
        state = after.state
    return reached.tolist()


@pytest.mark.parametrize(("name", "paper", "problems"), [("vo", 7, 22), ("sb_mpc", 7, 22), ("apf", 6, 20)])
def test_planners_reach_the_goal(name: str, paper: int, problems: int) -> None:
    reached = successes(name, PAPER + IMAZU)
    assert sum(reached[:7]) >= paper
    assert sum(reached[7:]) >= problems


@pytest.mark.parametrize("name", PLANNERS)
def test_a_give_way_ship_passes_astern(name: str) -> None:
    env = make_env(IMAZU[1], WORLD)
    (episode,) = rollout(env, load_policy(name, env))
    # When own ship crosses the other's track, the other has passed its bow, and own ship has turned for it.
    ahead = episode.states[:, 1] > 0
    crossed = int(ahead.nonzero()[0, 0])
    assert episode.states[crossed, 9] < episode.states[crossed, 0]
    assert episode.states[:crossed, 0].max() > 10


@pytest.mark.parametrize("name", PLANNERS)
def test_rows_do_not_depend_on_each_other_nor_on_earlier_episodes(name: str) -> None:
    """The second row begins five steps after the first, and acts as if it were alone."""
    together, alone, transition = make(name, 2), make(name, 1), Transition(WORLD)
    first, second = initial_states([IMAZU[15]]), initial_states([IMAZU[4]])
    state, lone = torch.cat((first, initial_states([IMAZU[1]]))), second
    for step in range(30):
        if step == 5:
            state = torch.cat((state[:1], second))
        action = together(TensorDict({"state": state}, batch_size=[2]))["action"]
        if step >= 5:
            expected = alone(TensorDict({"state": lone}, batch_size=[1]))["action"]
            assert action[1:].equal(expected)
            lone = transition(lone, expected).state
        state = transition(state, action).state
