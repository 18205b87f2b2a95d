"""`python -m studies.frontier`: what keeping the steering rules costs in success, at six weights.

Each network learns from numbers as `pretrained:traffic_rules` does, with its own payment and cost of lateness
and one seed: some ten minutes on one core. Missing runs are made, one after the other.

Writes:
    FOLDER/WEIGHT/           the runs
    FOLDER/frontier.csv      a row for each weight
    FOLDER/frontier.png      success against the share of engaged encounters in which own ship obeys
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import override
from ship_trl.files.disk import atomic_write
from ship_trl.run.pretrain import RULES as LEARNED

WEIGHTS = (0, 50, 100, 200, 300, 600)
WORDS = "target=traffic", "method=scratch", *LEARNED
SUITES = ("traffic_test", "traffic_dense", "traffic_reacting")
RULES = (8, 13, 14, 15, 16)


def train(runs: dict[Path, tuple[str, ...]]) -> None:
    """Make the missing runs, each of some words in a folder, and exit if one fails."""
    for folder, words in runs.items():
        command = [sys.executable, "-m", "ship_trl", *words, override("output", folder)]
        if code := subprocess.run(command, check=False).returncode:
            sys.exit(code)


def measure(policy: str) -> dict[str, float]:
    """Return a policy's success on each suite, and on the first one how it keeps the rules."""
    import ship_trl
    from ship_trl.fast.worlds import draw_starts, make_env
    from ship_trl.learn.rollout import rollout
    from ship_trl.policies.metrics import measure_episodes
    from ship_trl.sim.cases import load_suite, load_world

    world, row = load_world(), dict[str, float]()
    for name in SUITES:
        suite = load_suite(name, world)
        env = make_env(suite, world, starts=draw_starts(suite, world, len(suite.cases) or 500, 0))
        episodes = rollout(env, ship_trl.load_policy(policy))
        row[name] = sum(one.goal for one in episodes) / len(episodes)
        if name == SUITES[0]:
            found = measure_episodes(episodes, world)
            row["obeys"] = float(np.nanmean(found.ships["obeys"]))
            row |= {f"R{rule}": float(found.known(f"rule_{rule}").mean()) for rule in RULES}
    return row


def draw(path: Path, rows: list[dict[str, float]]) -> None:
    """Draw success against obedience."""
    from matplotlib.figure import Figure

    figure = Figure((6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    obeys, success = ([100 * row[key] for row in rows] for key in ("obeys", SUITES[0]))
    axes.plot(obeys, success, "o-", color="#1f6fb4")
    for row, x, y in zip(rows, obeys, success, strict=True):
        axes.annotate(f"{row['weight']:g}", (x, y), (6, 4), textcoords="offset points", fontsize=12)
    axes.set_xlabel("obeys, % of engaged head-on and give-way ships", fontsize=12)
    axes.set_ylabel(f"success in {SUITES[0]}, %", fontsize=12)
    axes.set_title("Labels: margin.rules", fontsize=12)
    axes.margins(0.1)
    axes.grid(alpha=0.3)
    with atomic_write(path) as draft:
        figure.savefig(draft, format="png", dpi=100)


def main() -> None:
    """Train, measure and draw."""
    parser = make_parser("", __doc__)
    parser.prog = "python -m studies.frontier"
    parser.add_argument("folder", type=Path, nargs="?", default=Path("outputs/frontier"), help="of the runs")
    folder = parser.parse_args().folder
    os.environ["MPLBACKEND"] = "agg"
    train(
        {
            folder / str(weight): (*WORDS, f"margin.rules={weight}", f"margin.timeout={300 + weight}")
            for weight in WEIGHTS
        }
    )
    import pandas as pd

    rows = [{"weight": float(weight)} | measure(str(folder / str(weight))) for weight in WEIGHTS]
    table = pd.DataFrame(rows)
    with atomic_write(folder / "frontier.csv") as draft:
        table.to_csv(draft, index=False, float_format="%.4f")
    draw(folder / "frontier.png", rows)
    sys.stdout.write(table.round(3).to_string(index=False) + "\n")


if __name__ == "__main__":
    main()
