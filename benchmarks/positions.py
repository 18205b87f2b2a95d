"""Measure how long AIS tables of made-up ships take to read as suites, and by pandas alone.

    python -m benchmarks.positions 1 3 10

Numbers are millions of rows. A day has a row a minute of each ship; more ships are in a larger sea, as dense.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas

from ship_trl.cli.parser import make_parser
from ship_trl.config.bounds import KNOT
from ship_trl.formats.ais import AIS_COLUMNS
from ship_trl.formats.situation import metres_per_degree
from ship_trl.run.console import show

ROOT = Path(__file__).resolve().parents[1]
MINUTES, LATITUDE, LONGITUDE = 1440, 30.0, -60.0
# Ships of a million rows begin in a square of this side (degrees): as many as in a busy sea.
SIDE = 3.0
WAYS = {
    "ship_trl": "from ship_trl.foreign.suites import read_cases\n"
    "from ship_trl.sim.cases import load_world\n"
    "read_cases(sys.argv[1], load_world())",
    "pandas.read_csv": "import pandas\npandas.read_csv(sys.argv[1])",
}
# Linux says how much was resident at most.
SIZE = "next(line for line in open('/proc/self/status') if 'VmHWM' in line).split()[1]"
MEASURED = f"import sys, time\n{{}}\nprint(time.process_time(), {SIZE})"


def write_table(path: Path, rows: int) -> None:
    """Write a table in MarineCadastre's form: ships on straight courses that turn once at most."""
    generator, ships = np.random.default_rng(0), rows // MINUTES
    side = SIDE * (rows / 1e6) ** 0.5
    latitude, longitude = side * generator.random((2, ships)) + [[LATITUDE], [LONGITUDE]]
    course, knots = 360 * generator.random(ships), generator.uniform(6, 18, ships)
    turns = generator.integers(0, 2 * MINUTES, ships)
    table = pandas.DataFrame(columns=AIS_COLUMNS.split(","))
    table = table.assign(mmsi=200_000_001 + np.arange(ships), vessel_name="A", status=0, transceiver="A")
    table.iloc[:0].to_csv(path, index=False)
    for minute in range(MINUTES):
        course = np.where(turns == minute, (course + 120) % 360, course)
        east, north = metres_per_degree(latitude)
        latitude = latitude + 60 * KNOT * knots * np.cos(np.radians(course)) / north
        longitude = longitude + 60 * KNOT * knots * np.sin(np.radians(course)) / east
        columns = {"latitude": latitude.round(5), "longitude": longitude.round(5), "sog": knots.round(1)}
        stamp = pandas.Timestamp("2025-06-01") + pandas.Timedelta(minutes=minute)
        table = table.assign(base_date_time=stamp, cog=course.round(1) % 360, **columns)
        table.to_csv(path, index=False, header=False, mode="a", date_format="%Y-%m-%d %H:%M:%S")


def main() -> None:
    """Write the tables, read each in a process of its own, and print the table of times and sizes."""
    parser = make_parser("", __doc__)
    parser.add_argument("millions", nargs="*", type=int, default=[1, 3, 10], help="default: 1 3 10")
    measured = []
    for millions in parser.parse_args().millions:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "day.csv"
            write_table(path, millions * 1_000_000)
            for name, code in WAYS.items():
                words = [sys.executable, "-c", MEASURED.format(code), str(path)]
                done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
                seconds, kilobytes = map(float, done.stdout.split())
                measured.append((f"{millions} million", name, f"{seconds:.0f}", f"{kilobytes / 1e6:.2f}"))
    show(("rows", "read by", "seconds of a core", "peak (GB)"), measured, True)


if __name__ == "__main__":
    main()
