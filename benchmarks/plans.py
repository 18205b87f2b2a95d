"""Search for the best known plan of each bundled case: `python -m benchmarks.plans`."""

from __future__ import annotations

import sys

from ship_trl.config.paths import conf_dir
from ship_trl.policies.planner import best_plan
from ship_trl.policies.reference import BUNDLED_PLANS, plan_name, save_plan
from ship_trl.sim.cases import load_case, load_world


def main() -> None:
    """Search for the plans of all bundled cases, and replace the bundled plans."""
    world, names = load_world(), set()
    for path in sorted((conf_dir() / "case").glob("*.yaml")):
        case = load_case(str(path), world)
        plan, name = best_plan(case, world), plan_name(case, world)
        save_plan(BUNDLED_PLANS / name, plan)
        names.add(name)
        sys.stdout.write(f"case {case.name}: {plan.episode_return:.1f}\n")
    for old in BUNDLED_PLANS.glob("*.json"):
        if old.name not in names:
            old.unlink()


if __name__ == "__main__":
    main()
