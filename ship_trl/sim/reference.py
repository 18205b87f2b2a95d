"""The best known plan of a case: it belongs to the case, so it is searched for once and kept."""

from __future__ import annotations

import hashlib
import inspect
import json
from pathlib import Path

import torch

from ship_trl.config import World, plain
from ship_trl.paths import replacing
from ship_trl.sim import reward
from ship_trl.sim.cases import Case
from ship_trl.sim.planner import Plan, best_plan
from ship_trl.sim.transition import Transition

# Goes up with every change of the planner that may find another plan.
PLANNER_VERSION = 2
_known: dict[str, Plan] = {}


def best_known(case: Case, world: World, folder: Path | None = None) -> Plan:
    """Return the planner's best plan, from this process's memory or from `folder` where it is there.

    A plan that was kept is sailed before it is believed, so that a damaged file is found out and replaced.

    Args:
        case: where to sail.
        world: physics and reward.
        folder: where plans are kept, one file each; made where there is none.
    """
    # A formula that was edited may have another best plan, even where it pays the kept one the same.
    words = (PLANNER_VERSION, case.fingerprint, plain(world), inspect.getsource(reward))
    digest = hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest()[:12]
    if digest in _known:
        return _known[digest]
    path = None if folder is None else folder / f"{case.name}-{digest}.json"
    plan = None if path is None else _read(path, case, world)
    if plan is None:
        plan = best_plan(case, world)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as draft:
                draft.write_text(json.dumps({"return": plan.episode_return, "actions": plan.actions}))
    _known[digest] = plan
    return plan


def _read(path: Path, case: Case, world: World) -> Plan | None:
    """Read a plan and sail it; None where it is not there, or does not reach what it says."""
    try:
        kept = json.loads(path.read_text())
        plan = sail(case, world, [int(action) for action in kept["actions"]])
        return plan if plan.episode_return == kept["return"] else None
    except (OSError, ValueError, KeyError, TypeError, IndexError):
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
