"""The best known plan of each case, cached as a JSON file because the search takes long.

`plans/` has those of the bundled cases in the paper's world; `python -m studies.scenes plans` rewrites it.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from functools import cache
from pathlib import Path

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World
from ship_trl.config.world import world_values
from ship_trl.files.disk import atomic_write, read_json
from ship_trl.policies.planner import Plan, best_plan
from ship_trl.sim.cases import Case
from ship_trl.sim.scene_table import Scene, read_scenes
from ship_trl.sim.state import initial_state
from ship_trl.sim.suites import Suite
from ship_trl.sim.transition import Transition

# Increase it with every change of the planner or of a reward term's formula that may find another plan.
PLANNER_VERSION = 2
BUNDLED_PLANS = Path(__file__).parent / "plans"
# Raw return. Processors round differently, so a cached plan's return may differ by this much.
RETURN_TOLERANCE = 1e-3
# By file name.
_cached_plans: dict[str, Plan] = {}


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
        paths = [place / name for place in (folder, BUNDLED_PLANS) if place is not None]
        plan = next((plan for path in paths if (plan := _read(path, case, world)) is not None), None)
        if (plan := plan or _read_table(case, world)) is None:
            return None
        _cached_plans[name] = plan
    return _cached_plans[name]


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
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as draft:
        draft.write_text(json.dumps({"return": plan.episode_return, "actions": plan.actions}))


def _read(path: Path, case: Case, world: World) -> Plan | None:
    """Read a plan and roll it out; return None if the file is missing, damaged or gives another return."""
    try:
        values = read_json(path)
        actions = values["actions"]
        if not all(type(action) is int and 0 <= action < len(world.actions) for action in actions):
            return None
        plan = follow_plan(case, world, actions)
        return plan if abs(plan.episode_return - values["return"]) < RETURN_TOLERANCE else None
    except (OSError, ValueError, KeyError, TypeError, IndexError, OverflowError, RuntimeError):
        return None


@cache
def table_plans() -> dict[str, Scene]:
    """Return the scenes of the bundled tables, with their plans, by the case's fingerprint."""
    found: dict[str, Scene] = {}
    for table in sorted((conf_dir() / "suite").glob("*.csv")):
        # A suite refuses its broken table; other cases do not need it.
        with suppress(ConfigError):
            found |= {scene.case.fingerprint: scene for scene in read_scenes(table)}
    return found


def _read_table(case: Case, world: World) -> Plan | None:
    """Return a plan of the bundled tables; None if there is none or it gives another return."""
    scene = table_plans().get(case.fingerprint)
    if scene is None or max(scene.actions, default=0) >= len(world.actions):
        return None
    plan = follow_plan(case, world, scene.actions)
    return plan if abs(plan.episode_return - scene.best_return) < 2 * RETURN_TOLERANCE else None


def follow_plan(case: Case, world: World, actions: list[int]) -> Plan:
    """Roll out a sequence of actions until it or the episode ends; return it with its outcome.

    Raises:
        IndexError: action index out of range.
    """
    step = Transition(world)
    state, total, goal = initial_state(case, world)[None], torch.zeros(1, dtype=torch.float64), False
    for action in actions:
        after = step(state, torch.tensor([action]))
        total, state, goal = total + after.reward, after.state, bool(after.goal)
        if goal or bool(after.collision | after.truncated):
            break
    return Plan(float(total), actions, goal)
