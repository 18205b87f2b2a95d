"""The table of what own ship does about engaged ships, by class of encounter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ship_trl.policies.metrics import CLASS_NAMES, HOLD, SPEED_CHANGE, STAGE4, STARBOARD, TURN, Measurements
from ship_trl.sim.encounter import Encounter

HEADINGS = (
    *("suite", "policy", "encounter", "success", "collision", "obeys", "engaged", "starboard action"),
    *("turn, degrees", "range, m (safe distances)", "bow crossings", "kept course"),
)
KEEPS_CLEAR = Encounter.HEAD_ON, Encounter.GIVE_WAY, Encounter.OVERTAKING
STANDS_ON = Encounter.STAND_ON, Encounter.OVERTAKEN


def rule_rows(measured: Measurements, safe: float) -> Iterator[list[str]]:
    """Yield the cells of `HEADINGS` from `encounter` on: for all ships, then for each class.

    Args:
        measured: episodes of one policy in one suite.
        safe: the world's safe distance (m).
    """
    ships = measured.ships
    kinds = ships["encounter"]
    count = int((kinds != "").sum())
    is_engaged = (kinds != "") & (kinds != CLASS_NAMES[Encounter.NONE])

    def engaged(flags: NDArray[np.bool_]) -> str:
        return f"{flags.sum()} ({flags.sum() / max(count, 1):.0%})"

    ends = (share(measured.outcomes == end) for end in ("goal", "collision"))
    obeys = known(ships["obeys"])
    yield ["all", *ends, f"{share(obeys)} of {obeys.size}" * bool(obeys.size), engaged(is_engaged), *[""] * 5]
    for kind in (*KEEPS_CLEAR, *STANDS_ON):
        rows = kinds == CLASS_NAMES[kind]
        own = {name: values[rows] for name, values in ships.items()}
        starboard = (own["side"] == "starboard") & (own["turn"] >= STARBOARD[0])
        ranges = known(own["range"])
        yield [
            *(CLASS_NAMES[kind], "", "", share(known(own["obeys"])), engaged(rows)),
            share(starboard) if kind in KEEPS_CLEAR else "",
            f"{np.median(own['turn']):.0f}" if rows.any() else "",
            f"{np.median(ranges):.0f} ({np.median(ranges) / safe:.1f})" if ranges.size else "",
            *(share(known(own[name])) for name in ("bow_crossing", "kept_course")),
        ]


def known(values: NDArray[Any]) -> NDArray[Any]:
    """Return the values that are not NaN, in one row."""
    return values[~np.isnan(values)]


def share(flags: NDArray[Any]) -> str:
    """Return the share of flags that are true, empty without flags."""
    return f"{flags.mean():.0%}" if flags.size else ""


def describe_rules(safe: float) -> str:
    """Return the line that explains the table, for a safe distance (m)."""
    return (
        "Engaged: ships with which an encounter begins while own ship is under way (DCPA below "
        f"{safe * 4 / 3:g} m within 30 s), and their share of all ships. Other shares and medians are of "
        f"them. The first action is the first change of course beyond {TURN[0]:g} degrees within {HOLD:g} s. "
        "Turn: median of the largest turn to its side, 0 without an action. Starboard action: such a turn of "
        f"{STARBOARD[0]:g} degrees or more to starboard. Range: median distance at which it begins, also in "
        f"safe distances of {safe:g} m. Bow crossings: by the aspect at the closest approach; head-on, ships "
        f"that do not pass port to port. Kept course: no change beyond {TURN[0]:g} degrees or "
        f"{100 * SPEED_CHANGE[0]:g} % of the speed while more than {STAGE4:g} m apart. Obeys: of head-on and "
        "give-way ships, a starboard action without a bow crossing."
    )
