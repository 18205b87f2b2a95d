"""The best known plan of a case: it belongs to the case, so it is searched for once and kept.

`plans/` holds those of the shipped cases in the shipped world; `python -m ship_trl.sim.reference` searches
for them anew.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import sys
from pathlib import Path

import torch

from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World, plain
from ship_trl.files.disk import read_json, replacing
from ship_trl.sim import reward
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.planner import Plan, best_plan
from ship_trl.sim.transition import Transition

# Goes up with every change of the planner that may find another plan.
PLANNER_VERSION = 2
SHIPPED = Path(__file__).parent / "plans"
# Of a raw return: by so much a plan may pay more or less on another processor, which rounds differently.
ROUNDING = 1e-3
_known: dict[str, Plan] = {}


def best_known(case: Case, world: World, folder: Path | None = None) -> Plan:
    """Return the planner's best plan: from memory, from `folder`, from what is shipped, or by a search.

    A plan that was kept is sailed before it is believed, so that a damaged file is found out and replaced.

    Args:
        case: where to sail.
        world: physics and reward.
        folder: where plans are kept, one file each; made where there is none.
    """
    name = plan_name(case, world)
    if name in _known:
        return _known[name]
    kept = [place / name for place in (folder, SHIPPED) if place is not None]
    plan = next((plan for path in kept if (plan := _read(path, case, world)) is not None), None)
    if plan is None:
        plan = best_plan(case, world)
        if folder is not None:
            write_plan(folder / name, plan)
    _known[name] = plan
    return plan


def plan_name(case: Case, world: World) -> str:
    """Name the file of a case's plan after all that it follows from; what the case is called is not of it."""
    # A formula that was edited may have another best plan, even where it pays the kept one the same.
    words = (PLANNER_VERSION, case.fingerprint, plain(world), inspect.getsource(reward))
    return hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest()[:12] + ".json"


def write_plan(path: Path, plan: Plan) -> None:
    """Keep a plan as JSON; makes the folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as draft:
        draft.write_text(json.dumps({"return": plan.episode_return, "actions": plan.actions}))


def _read(path: Path, case: Case, world: World) -> Plan | None:
    """Read a plan and sail it; None where it is not there, or does not reach what it says."""
    try:
        kept = read_json(path)
        actions = kept["actions"]
        if not all(type(action) is int and 0 <= action < len(world.actions) for action in actions):
            return None
        plan = sail(case, world, actions)
        return plan if abs(plan.episode_return - kept["return"]) < ROUNDING else None
    except (OSError, ValueError, KeyError, TypeError, IndexError, OverflowError, RuntimeError):
        return None


def sail(case: Case, world: World, actions: list[int]) -> Plan:
    """Sail a sequence of actions, to its end or that of the episode.

    Raises:
        IndexError: an action that is none.
    """
    step = Transition(case, world, torch.device("cpu"))
    state, total, goal = step.start[None], torch.zeros(1, dtype=torch.float64), False
    for action in actions:
        after = step(state, torch.tensor([action]))
        total, state, goal = total + after.reward, after.state, bool(after.goal)
        if goal or bool(after.collision | after.truncated):
            break
    return Plan(float(total), actions, goal)


def main() -> None:
    """Search for the plans of all shipped cases, in place of those that are there."""
    world = load_world()
    for old in SHIPPED.glob("*.json"):
        old.unlink()
    for path in sorted((conf_dir() / "case").glob("*.yaml")):
        case = load_case(str(path), world)
        plan = best_plan(case, world)
        write_plan(SHIPPED / plan_name(case, world), plan)
        sys.stdout.write(f"case {case.name}: {plan.episode_return:.1f}\n")


if __name__ == "__main__":
    main()
