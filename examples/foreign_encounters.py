"""Write encounters of other hands: 200 situations of DNV's trafficgen, and a day of made-up AIS traffic.

    python examples/foreign_encounters.py outputs/foreign
    python -m ship_trl evaluate pretrained:traffic vo target=outputs/foreign/situations
    python -m ship_trl evaluate pretrained:traffic vo target=outputs/foreign/day.csv

It needs `pip install trafficgen==0.9.1`. Situations have one, two or three target ships, in every combination
of the five encounter types that trafficgen knows. The AIS day is synthetic: ships on straight courses, in the
form of Denmark's daily files.
"""

from __future__ import annotations

import json
import random
import sys
from datetime import UTC, datetime, timedelta
from itertools import combinations_with_replacement
from math import cos, radians, sin
from pathlib import Path

import numpy as np

SEED, SITUATIONS = 0, 200
TYPES = ("head-on", "crossing-give-way", "crossing-stand-on", "overtaking-give-way", "overtaking-stand-on")
POSITION = {"lat": 56.0, "lon": 11.0}
SHIP = {"id": 1, "dimensions": {"length": 150.0, "width": 25.0}, "shipType": "Cargo", "sogMax": 25.0}
# Ships of the AIS day, its seconds and metres, and seconds between two rows of a ship.
SHIPS, SECONDS, SIDE, EVERY = 250, 6 * 3600, 60_000, 30


def make_situations(folder: Path) -> None:
    """Let trafficgen write situations, with its own classes and settings."""
    try:
        import trafficgen
    except ImportError:
        sys.exit("situations need trafficgen: pip install trafficgen==0.9.1")
    from trafficgen.ship_traffic_generator import generate_traffic_situations
    from trafficgen.write_traffic_situation_to_file import write_traffic_situations_to_json_file

    draw = random.Random(SEED)
    wanted = [types for count in (1, 2, 3) for types in combinations_with_replacement(TYPES, count)]
    asked, targets, made = folder / "asked", folder / "targets", folder / "situations"
    for each in (asked, targets, made):
        each.mkdir(parents=True, exist_ok=True)
    for name in (targets / "ship.json", folder / "own.json"):
        name.write_text(json.dumps(SHIP))
    for number in range(SITUATIONS):
        types, course = wanted[number % len(wanted)], float(draw.randrange(360))
        initial = {
            "position": POSITION,
            "sog": float(draw.randrange(8, 17)),
            "cog": course,
            "heading": course,
        }
        encounters = [{"desiredEncounterType": one, "vectorTime": [10.0, 20.0]} for one in types]
        values = {"title": " ".join(types), "description": "", "numSituations": 1}
        values |= {"ownShip": {"initial": initial}, "encounters": encounters}
        (asked / f"{number:03}.json").write_text(json.dumps(values))
    # Their package draws from the global generators.
    random.seed(SEED)
    np.random.seed(SEED)  # noqa: NPY002
    settings = Path(trafficgen.__file__).parent / "settings/encounter_settings.json"
    found = generate_traffic_situations(
        situations_data=asked,
        own_ship_data=folder / "own.json",
        target_ships_data=targets,
        settings_data=settings,
    )
    write_traffic_situations_to_json_file(found, write_folder=made)


def make_day(path: Path) -> None:
    """Write ships on straight courses as rows of AIS positions, sorted by time."""
    draw = random.Random(SEED)
    start, rows = datetime(2025, 6, 1, tzinfo=UTC), []
    for number in range(SHIPS):
        x, y, begin = (
            draw.uniform(-SIDE / 2, SIDE / 2),
            draw.uniform(-SIDE / 2, SIDE / 2),
            draw.randrange(SECONDS),
        )
        course, knots = draw.uniform(0, 360), round(draw.uniform(7, 18), 1)
        for second in range(begin, min(begin + 5400, SECONDS), EVERY):
            way = knots * 1852 / 3600 * (second - begin)
            east, north = x + way * sin(radians(course)), y + way * cos(radians(course))
            latitude = POSITION["lat"] + north / 111_362
            longitude = POSITION["lon"] + east / (111_320 * cos(radians(POSITION["lat"])))
            stamp = (start + timedelta(seconds=second)).strftime("%d/%m/%Y %H:%M:%S")
            place = f"{latitude:.6f},{longitude:.6f}"
            rows.append((second, f"{stamp},Class A,{219000001 + number},{place},{knots},{course % 360:.1f}"))
    lines = [
        "# Timestamp,Type of mobile,MMSI,Latitude,Longitude,SOG,COG",
        *(text for _, text in sorted(rows)),
    ]
    path.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else "outputs/foreign")
    FOLDER.mkdir(parents=True, exist_ok=True)
    make_day(FOLDER / "day.csv")
    make_situations(FOLDER)
    print(f"{FOLDER / 'situations'}\n{FOLDER / 'day.csv'}")
