"""Draw how an encounter is found in AIS positions: distance, DCPA and TCPA of two ships over time.

    python examples/ais_encounter.py outputs/foreign/day.csv outputs/encounter.png 20

The dashed line is the moment at which encounter 20 begins (its scene ends in -20): own ship starts there.
It is the first at which DCPA and TCPA lie below their dotted limits.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure

from ship_trl.config.types import OwnShip
from ship_trl.foreign import tracks
from ship_trl.formats import ais
from ship_trl.sim.geometry import predicted_approach

# Metres and seconds: 0.4 NM and 15 minutes, as in docs/foreign.md; then what ends an encounter, the view, and
# the least TCPA of one that is seen in time.
LIMITS = tracks.Limits(0.4 * 1852, 900.0, 0.6 * 1852, 4.3 * 1852, soonest=240.0)


def main(table: str, picture: str, number: str) -> None:
    """Write a PNG of one encounter."""
    fixes = ais.read_table(Path(table))
    situations = tracks.find_encounters(fixes, LIMITS, OwnShip.gives_way, 1).situations
    if not 1 <= int(number) <= len(situations):
        sys.exit(f"{table}: no encounter {number}; allowed: 1 to {len(situations)}")
    situation = situations[int(number) - 1]
    samples = tracks.resample(fixes, tracks.INSTANT)
    assert situation.start is not None and situation.origin is not None
    start = situation.start.timestamp()
    # Own ship is where the situation's plane touches the earth; the other ship is its first target ship.
    place = situation.origin.to_degrees(situation.targets[0].x, situation.targets[0].y)
    now = np.flatnonzero(samples.instant == start)
    ships = [
        samples.ship[now[np.hypot(*(samples.place[now] - [longitude, latitude]).T).argmin()]]
        for latitude, longitude in (situation.origin, place)
    ]
    own, other = (np.flatnonzero(samples.ship == ship) for ship in ships)
    _, mine, theirs = np.intersect1d(samples.instant[own], samples.instant[other], return_indices=True)
    away, motion = tracks.relative(samples, own[mine], other[theirs])
    dcpa, tcpa = map(np.asarray, predicted_approach(torch.from_numpy(away), torch.from_numpy(motion)))
    minutes = (samples.instant[own[mine]] - start) / 60
    figure = Figure(figsize=(8, 5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(minutes, np.hypot(*away.T) / 1852, label="distance")
    for axes, values, limit, label in (
        (upper, dcpa / 1852, LIMITS.dcpa / 1852, "DCPA"),
        (lower, tcpa / 60, LIMITS.tcpa / 60, "TCPA"),
    ):
        (line,) = axes.plot(minutes, values, label=label)
        axes.axhline(limit, color=line.get_color(), linestyle=":")
        axes.axvline(0, color="black", linestyle="--")
        axes.legend()
    upper.set(ylabel="nautical miles", ylim=(0, 10), title=f"{situation.start:%d %B %Y, %H:%M} UTC")
    lower.set(ylabel="minutes", xlabel="minutes after the encounter begins", xlim=(-15, 25), ylim=(-5, 25))
    figure.savefig(picture, dpi=100)


if __name__ == "__main__":
    main(*sys.argv[1:])
