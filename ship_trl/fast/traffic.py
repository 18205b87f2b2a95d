"""`sim.traffic.draw_scenes` as a compiled loop."""

from __future__ import annotations

from numba.extending import register_jitable

from ship_trl.fast.jit import RELAXED, Loop, compiled
from ship_trl.sim import encounter, traffic

for shared in (encounter.meets, encounter.crosses, encounter.overtakes, encounter.classify):
    register_jitable(shared)
LOOPS: tuple[Loop, ...] = (
    encounter.bearing_of,
    traffic.uniform,
    traffic.draw_ship,
    traffic.keeps_clear,
    traffic.draw_ships,
    traffic.is_solvable,
)
for loop in LOOPS:
    register_jitable(fastmath=RELAXED, error_model="numpy")(loop)
draw_scenes = compiled(RELAXED)(traffic.draw_scenes)
