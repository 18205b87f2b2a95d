"""`python -m studies.scenes scenes|plans`: choose the scenes of `traffic_test`, search for the bundled plans.

Each writes again what ships with the package: the table of scenes, the best known plan of each bundled case.

Seeds are taken in turn, and a scene is kept while its stratum has room and the planner reaches the goal in
it. A stratum is a number of ships and the class of encounter of the first one. Runs draw their scenes from
streams of 63 bits, so that they do not train on the first seeds.
"""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple
from functools import partial
from itertools import count

from torch import Generator

from ship_trl.cli.exam import write_scenes
from ship_trl.cli.parser import make_parser
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import EncounterClass, World
from ship_trl.fast.worlds import make_starts
from ship_trl.policies.planner import best_plan
from ship_trl.policies.reference import BUNDLED_PLANS, plan_name, save_plan
from ship_trl.sim.cases import (
    Case,
    Scene,
    TargetShip,
    load_case,
    load_suite,
    load_world,
)
from ship_trl.sim.encounter import Encounter, classify, relative_motion
from ship_trl.sim.state import SHIP_COUNT, first_case

# 15 strata of 32 scenes with ships, and 20 scenes without.
ROOM, EMPTY_ROOM = 32, 20
# Searches that run before the next scenes are drawn.
BATCH = 16
# Plans kept from step to step; with six times as many a search takes six times as long.
BEAM = 1000
# Metres and degrees keep four decimals in the table.
DIGITS = 4


def draw_case(seed: int, world: World) -> tuple[tuple[int, str], Case]:
    """Return the stratum and the case of a seed."""
    suite = load_suite("traffic_near", world)
    state = make_starts(suite, world).sample(1, Generator().manual_seed(seed))
    ships, motion = int(state[0, SHIP_COUNT]), relative_motion(state)
    first = int(classify(motion.bearing, motion.aspect)[0, 0]) if ships else Encounter.NONE
    encounter = Encounter(first).name.lower()
    drawn = first_case(suite, state[0])
    places = [[round(number, DIGITS) for number in astuple(ship)[:4]] for ship in drawn.target_ships]
    # Exactly as the table is read: float32 holds no 90 degrees.
    found = [TargetShip(*one) for one in places]
    case = Case([0.0, 0.0], 90.0, [0.0, 600.0], encounter, found, f"traffic_{seed}")
    return (ships, encounter), case


def write_table() -> None:
    """Choose the scenes, with all processors, and write the table."""
    world, kept, failed = load_world(), list[Scene](), list[str]()
    room = Counter({(ships, one.name): ROOM for ships in (1, 2, 3) for one in EncounterClass})
    room[0, "none"] = EMPTY_ROOM
    seeds = count()
    with ProcessPoolExecutor() as pool:
        while room.total():
            cases: list[tuple[tuple[int, str], Case]] = []
            while room.total() and len(cases) < BATCH:
                stratum, case = draw_case(next(seeds), world)
                if room[stratum]:
                    room[stratum] -= 1
                    cases.append((stratum, case))
            plans = pool.map(partial(best_plan, world=world, beam=BEAM), [case for _, case in cases])
            for (stratum, case), plan in zip(cases, plans, strict=True):
                if plan.goal:
                    kept.append(Scene(case, plan.episode_return, plan.actions))
                else:
                    room[stratum] += 1
                    failed.append(case.name)
    write_scenes(conf_dir() / "suite" / "traffic_test.csv", kept)
    sys.stdout.write(f"{len(kept)} scenes; no plan reaches the goal in {', '.join(failed) or 'none'}\n")


def write_plans() -> None:
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
    parser = make_parser("", __doc__)
    parser.prog = "python -m studies.scenes"
    parser.add_argument("what", choices=("scenes", "plans"), help="what is written again")
    {"scenes": write_table, "plans": write_plans}[parser.parse_args().what]()
