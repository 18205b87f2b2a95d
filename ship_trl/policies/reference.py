"""Policies that learn nothing, and the returns that are the zero and the one of scores: random, best known.

The best known plan of each case is cached as a JSON file because the search takes long. `plans/` has those of
the bundled cases in the paper's world; `python -m studies.scenes plans` rewrites it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

import torch
from tensordict import TensorDictBase
from torch import Generator

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World, world_values
from ship_trl.fast.worlds import make_env, make_starts, make_step
from ship_trl.files.disk import atomic_write, read_json
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Policy, greedy_policy, rollout
from ship_trl.policies.planner import Plan, best_plan, best_plan_from
from ship_trl.sim.cases import Case, Scene, Suite, read_scenes, suite_of
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.replay import with_replay
from ship_trl.sim.starts import Starts
from ship_trl.sim.state import STEP, initial_state
from ship_trl.sim.transition import Transition

# Increase it with every change of the planner or of a reward term's formula that may find another plan.
PLANNER_VERSION = 2
BUNDLED_PLANS = Path(__file__).parent / "plans"
# Raw return. A kept plan's may differ by this: tables round to 5e-4, processors differ by some 1e-6.
RETURN_TOLERANCE = 1e-3
# Episodes of `random_return`: with this many the standard error of the mean is about 2.
EPISODES = 10_000
# By file name.
_cached_plans: dict[str, Plan] = {}


def random_actions(env: ShipEnv, seed: int = 0) -> Policy:
    """Return the policy that draws its actions uniformly."""
    generator = Generator(device=env.device).manual_seed(seed)
    count = len(env.world.actions)

    def policy(step: TensorDictBase) -> TensorDictBase:
        action = torch.randint(count, step.batch_size, generator=generator, device=env.device)
        return step.set("action", action)

    return policy


def random_return(
    suite: Suite, world: World, seed: int = 0, episodes: int = EPISODES, *, fast: bool = True
) -> float:
    """Return the mean undiscounted raw return of uniform random actions in a suite, its cases in turn.

    All runs use the same seed of actions and starts, so that their scores share one zero. `fast` is of
    `make_step`.
    """
    step = with_replay(make_step(world, fast=fast), suite, world)
    generator = Generator().manual_seed(seed)
    state = make_starts(suite, world).balanced(episodes, generator).contiguous()
    total = torch.zeros(episodes, dtype=torch.float64)
    running = torch.ones(episodes, dtype=torch.bool)
    while bool(running.any()):
        action = torch.randint(len(world.actions), (episodes,), generator=generator)
        after = step(state, action)
        total += after.reward * running
        running &= ~(after.goal | after.collision | after.truncated)
        state = after.state
    return float(total.mean())


def keep_course(env: ShipEnv, _: int = 0) -> Policy:
    """Return the policy that keeps its course."""
    straight = env.world.straight_action

    def policy(step: TensorDictBase) -> TensorDictBase:
        return step.set("action", torch.full_like(step["state"][..., STEP], straight, dtype=torch.int64))

    return policy


def follow_best_known(env: ShipEnv, _: int = 0) -> Policy:
    """Return the policy that follows the planner's best plan of each case, or of each drawn start."""
    if env.suite.is_drawn:
        return search_each_start(env)
    plans = [best_known(case, env.world).actions or [0] for case in env.suite.cases]
    length = max(map(len, plans))
    # A plan repeats its last action.
    table = torch.tensor([plan + plan[-1:] * (length - len(plan)) for plan in plans], device=env.device)
    starts = env.begun(Starts(env.suite, env.world).states)
    case = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)

    def policy(step: TensorDictBase) -> TensorDictBase:
        nonlocal case
        state = step["state"]
        time = state[..., STEP].long()
        if len(plans) == 1 or case.shape != time.shape:
            case = torch.zeros_like(time)
        if len(plans) > 1:
            # The plan of the case that a row has begun with.
            matches = (state[..., None, :] == starts).all(-1)
            begins = (time == 0) & matches.any(-1)
            case = torch.where(begins, matches.to(torch.int8).argmax(-1), case)
        return step.set("action", table[case, time.clamp(max=length - 1)])

    return policy


def search_each_start(env: ShipEnv) -> Policy:
    """Return the policy that searches for a plan when an episode begins, for seconds, and follows it."""
    length = env.world.max_steps
    plans = torch.empty(0, length, dtype=torch.int64)

    def policy(step: TensorDictBase) -> TensorDictBase:
        nonlocal plans
        state = step["state"].reshape(-1, step["state"].shape[-1]).cpu()
        if len(plans) != len(state):
            plans = torch.full((len(state), length), env.world.straight_action)
        time = state[:, STEP].long()
        for row in (time == 0).nonzero().flatten().tolist():
            actions = best_plan_from(state[row], env.suite, env.world).actions
            plans[row, : len(actions)] = torch.tensor(actions, dtype=torch.int64)
        action = plans.gather(1, time.clamp(max=length - 1)[:, None])
        return step.set("action", action.reshape(step.batch_size).to(env.device))

    return policy


def best_known(case: Case, world: World, folder: Path | None = None) -> Plan:
    """Return the best known plan, by a search if there is none; `folder` is as for `known_plan`.

    The search caches its plan in `folder`, which is created if needed.
    """
    plan = known_plan(case, world, folder)
    if plan is None:
        plan = _cached_plans[plan_name(case, world)] = best_plan(case, world)
        if folder is not None:
            save_plan(folder / plan_name(case, world), plan)
    return plan


def known_plan(case: Case, world: World, folder: Path | None = None) -> Plan | None:
    """Return the plan in memory, in `folder`, or of the bundled plans and tables; None without one.

    A plan from a file is rolled out first. A file whose plan gives another return is stale, and ignored.
    """
    name = plan_name(case, world)
    if name not in _cached_plans:
        for claimed, actions in _kept_plans(name, case, folder):
            if all(type(action) is int and 0 <= action < len(world.actions) for action in actions):
                plan = follow_plan(case, world, actions)
                if abs(plan.episode_return - claimed) < RETURN_TOLERANCE:
                    _cached_plans[name] = plan
                    break
    return _cached_plans.get(name)


def _kept_plans(name: str, case: Case, folder: Path | None) -> Iterator[tuple[float, list[int]]]:
    """Yield the returns and actions that files and the bundled tables claim; skip what cannot be read."""
    for place in (folder, BUNDLED_PLANS):
        with suppress(OSError, ValueError, KeyError, TypeError, OverflowError, RuntimeError):
            if place is not None:
                values = read_json(place / name)
                yield float(values["return"]), list(values["actions"])
    if scene := table_plans().get(case.fingerprint):
        yield scene.best_return, scene.actions


def best_known_return(
    suite: Suite, world: World, folder: Path | None = None, max_searches: int = 0
) -> float | None:
    """Return the mean best known return of a suite's cases; None if their starts are perturbed.

    It is also None where a plan is missing, and more than `max_searches` cases would be searched.
    """
    if suite.is_drawn:
        return None
    missing = [case for case in suite.cases if known_plan(case, world, folder) is None]
    if len(missing) > max_searches:
        return None
    returns = [best_known(case, world, folder).episode_return for case in suite.cases]
    return sum(returns) / len(returns)


def is_course_best(suite: Suite, world: World, known: float | None) -> bool:
    """Return whether holding course reaches the best known return of a suite, so that nothing is avoided."""
    if known is None:
        return False
    straight = [world.straight_action] * world.max_steps
    returns = [follow_plan(case, world, straight).episode_return for case in suite.cases]
    return sum(returns) / len(returns) > known - RETURN_TOLERANCE


def plan_name(case: Case, world: World) -> str:
    """Return the file name of a case's plan: a digest of planner, case and world."""
    inputs = (PLANNER_VERSION, case.fingerprint, world_values(world))
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:12] + ".json"


def save_plan(path: Path, plan: Plan) -> None:
    """Write a plan as JSON; create the folder if needed."""
    with atomic_write(path) as draft:
        draft.write_text(json.dumps({"return": plan.episode_return, "actions": plan.actions}))


@cache
def table_plans() -> dict[str, Scene]:
    """Return the scenes of the bundled tables, with their plans, by the case's fingerprint."""
    found: dict[str, Scene] = {}
    for table in sorted((conf_dir() / "suite").glob("*.csv")):
        # A suite refuses its broken table; other cases do not need it.
        with suppress(ConfigError):
            found |= {scene.case.fingerprint: scene for scene in read_scenes(table)}
    return found


def follow_plan(case: Case, world: World, actions: list[int]) -> Plan:
    """Roll out a sequence of actions until it or the episode ends; return it with its outcome.

    Raises:
        IndexError: action index out of range.
    """
    step = with_replay(Transition(world), suite_of(case), world)
    state, total, goal = initial_state(case, world)[None], torch.zeros(1, dtype=torch.float64), False
    for action in actions:
        after = step(state, torch.tensor([action]))
        total, state, goal = total + after.reward, after.state, bool(after.goal)
        if goal or bool(after.collision | after.truncated):
            break
    return Plan(float(total), actions, goal)


def score_bounds(case: Case, world: World, folder: Path | None = None) -> tuple[float, float]:
    """Return the mean return of random actions in a case, whose score is 0, and the best known return.

    `folder` is as for `best_known`.
    """
    return random_return(suite_of(case), world), best_known(case, world, folder).episode_return


def zero_shot(network: DuelingNetwork, case: Case, world: World, bounds: tuple[float, float]) -> float:
    """Return the score of a network's greedy episode in a case: 0 for random actions or worse.

    `bounds` are those of `score_bounds`.
    """
    env = make_env(suite_of(case), world)
    (episode,) = rollout(env, greedy_policy(network, env.observer(network.config, network.colour)))
    random, known = bounds
    return max(0.0, (episode.episode_return - random) / (known - random))
