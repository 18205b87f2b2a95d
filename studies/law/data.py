"""The kept tables as arrays: gains by seed, and a column of each property of a pair; plan.md names them.

Matrices are [targets, sources], NaN where source and target are one case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ship_trl.config.arm import SCRATCH
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.transfer.law import OF_CASE, OF_CASES, SOURCE, TARGET, ZERO_SHOT, describe
from ship_trl.transfer.similarity import characteristics
from studies.lockstep import read_runs
from studies.sources.judge import make_gains
from studies.sources.plan import FOLDER, SETTINGS, plan_tasks
from studies.sources.report import read_measures

Floats = NDArray[np.float64]
ORACLES = ("cka", "q_distance", "policy_agreement")
OF_SOURCE = ("visits", ZERO_SHOT, "agreement", "logme", "gradient")
TRAINED = SOURCE + "learned"
CASES = tuple(prefix + name for prefix in (SOURCE, TARGET) for name in OF_CASE)
LAW_OF_CASES = (*CASES, *OF_CASES)
COMMAND = (*LAW_OF_CASES, ZERO_SHOT)
LAW = (*LAW_OF_CASES, TRAINED, *OF_SOURCE)


@dataclass(frozen=True)
class Data:
    """What the tables say.

    Attributes:
        cases: names, in the order of targets and sources.
        contexts: characteristics of equation 7, [cases, 6].
        gains: [seeds, targets, sources] by arm.
        scratch: areas [targets, seeds] from scratch.
        of_cases: columns that need nothing trained, matrices by name; measures are larger for more similar.
        of_networks: those of the networks of each seed, [seeds, targets, sources].
        seconds: processor time of each measure, of a pair.
        runs: all runs.
    """

    cases: dict[str, Case]
    contexts: Floats
    gains: dict[str, Floats]
    scratch: Floats
    of_cases: dict[str, Floats]
    of_networks: dict[str, Floats]
    seconds: dict[str, float]
    runs: pd.DataFrame

    @property
    def count(self) -> int:
        """Number of cases."""
        return len(self.cases)

    def columns(self, seeds: Sequence[int] | slice = slice(None)) -> dict[str, Floats]:
        """Return all columns, as means over the networks of seeds."""
        return self.of_cases | {name: each[seeds].mean(0) for name, each in self.of_networks.items()}


def read(name: str) -> Data:
    """Read the tables of a setting of the study of sources."""
    setting, world = SETTINGS[name], load_world()
    folder, count = FOLDER / name, len(setting.cases)
    runs = read_runs(folder, plan_tasks(setting), f"python -m studies.sources run {name}")
    measures, seconds = read_measures(folder.with_name(f"{name}_measures.csv"), setting.cases, setting.seeds)
    place = {case: at for at, case in enumerate(setting.cases)}
    own = runs[(runs["arm"] == SCRATCH.name) & (runs["length"] == setting.target_length)]
    scratch = own.pivot_table(index="target", columns="seed", values="area").loc[list(place)].to_numpy()
    gains = {arm: one for (arm, kind), one in make_gains(runs, setting.cases).items() if kind == "area"}
    cases = {case: load_case(case, world) for case in setting.cases}
    contexts = np.array([list(characteristics(case, world).values()) for case in cases.values()])
    of_cases = {column: np.full((count, count), np.nan) for column in LAW_OF_CASES}
    for source, target in permutations(cases.values(), 2):
        for column, value in describe(source, target, world).items():
            of_cases[column][place[target.name], place[source.name]] = value
    best = runs[(runs["source"] == "") & (runs["length"] == setting.source_length)]
    scores = [
        (max(map(float, words.split())) - low) / (high - low)
        for words, low, high in zip(
            best["greedy"], best["random"].astype(float), best["best_known"].astype(float), strict=True
        )
    ]
    learned = best.assign(score=scores).pivot_table(index="seed", columns="target", values="score")[
        list(place)
    ]
    measures[TRAINED] = np.where(np.eye(count, dtype=bool), np.nan, learned.to_numpy()[:, None])
    return Data(cases, contexts, gains, scratch, of_cases, measures, seconds, runs)
