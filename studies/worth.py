"""`python -m studies.worth`: what each part of a network that avoids ships and keeps the rules is worth.

Each row differs from the first in one thing. All learn from numbers, one seed and 5,000 updates: about
three minutes on one core. Missing runs are made, one after the other.

Writes:
    FOLDER/PART/             the runs
    FOLDER/worth.csv         a row for each part: success on three suites, obedience, rule scores
"""

from __future__ import annotations

import sys
from pathlib import Path

from ship_trl.cli.parser import make_parser
from ship_trl.files.disk import atomic_write
from studies.frontier import measure, train

WORDS = "method=scratch", "observation=vector", "learn.episodes=64000"
# Words by part; of the same key the later one counts.
PARTS = {
    "all": ("target=traffic",),
    "near": ("target=traffic_near",),
    "three_ships": ("target=traffic", "network.ships=3"),
    "no_timeout": ("target=traffic", "margin.timeout=0"),
    # These two differ from the one before: without encounters a network sees no clock, and a collision must
    # cost more than a timeout.
    "no_encounters": ("target=traffic", "margin.timeout=0", "network.encounters=false"),
    "no_collision": ("target=traffic", "margin.timeout=0", "margin.collision=0"),
    "rules": ("target=traffic", "margin.rules=100"),
    "mask": ("target=traffic", "mask=rules"),
    "few_scenes": ("target=traffic", "learn.num_envs=64", "learn.update_every=64", "learn.episodes=8000"),
}
# A policy's mask at evaluation.
SHIELD = "+shield"


def main() -> None:
    """Train, measure and print."""
    parser = make_parser("", __doc__)
    parser.prog = "python -m studies.worth"
    parser.add_argument("folder", type=Path, nargs="?", default=Path("outputs/worth"), help="of the runs")
    folder = parser.parse_args().folder
    train({folder / part: (*WORDS, *words) for part, words in PARTS.items()})
    import pandas as pd

    policies = {part: str(folder / part) for part in PARTS}
    policies["shield"] = f"{folder / 'all'}{SHIELD}"
    table = pd.DataFrame([{"part": part} | measure(policy) for part, policy in policies.items()])
    with atomic_write(folder / "worth.csv") as draft:
        table.to_csv(draft, index=False, float_format="%.4f")
    sys.stdout.write(table.round(3).to_string(index=False) + "\n")


if __name__ == "__main__":
    main()
