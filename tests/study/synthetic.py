"""Runs with a known truth, written as a training would."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ship_trl.config.arm import ALL_LAYERS, Arm, SourceWeights
from ship_trl.files.curve import GREEDY, TRAINING
from ship_trl.files.record import RunRecord
from ship_trl.study.claims import Claims
from ship_trl.study.plan import plan_jobs, to_study
from ship_trl.study.study import Study
from tests.a_result import a_result, an_evaluation

BEST, RANDOM = 80.0, -320.0
# What could be gained by case and metric, so that tests do not hang on a study's margins.
GAIN = {"area": 0.12, "time": 0.15}
MARGINS = Claims(margin=0.2, gains={"2": GAIN, "4": GAIN, "6": GAIN | {"dip": 0.4}})
ARMS = ("scratch", "FE1", "FE2", "FE3", "FE4", "FT1", "FT2", "FT3", "FT4", "FTW")


def returns_of(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns of these scores."""
    return RANDOM + scores * (BEST - RANDOM)


def learning(
    rng: np.random.Generator, episodes: int = 200, end: float = 0.9, half: float = 40.0, noise: float = 0.1
) -> NDArray[np.float64]:
    """Scores that rise from 0 to `end`, half of it after `half` episodes: [episodes]."""
    t = np.arange(1, episodes + 1)
    return end * t / (t + half) + rng.normal(0, noise, episodes)


def write_run(
    folder: Path,
    scores: NDArray[np.float64],
    *,
    pair: str = "high",
    arm: str = "scratch",
    seed: int = 0,
    before: float = 0.0,
    every: int = 20,
    epsilon: NDArray[np.float64] | float = 0.1,
    **changes: Any,
) -> Path:
    """A run's folder below `folder`; greedy evaluations score like the episodes they follow."""
    place = folder / pair / arm / f"seed={seed}"
    place.mkdir(parents=True)
    totals = returns_of(scores)
    first = float(returns_of(np.array(before)))
    rates = np.broadcast_to(epsilon, totals.shape)
    lines: list[dict[str, Any]] = [{"episode": 0, "greedy_return": first, "greedy_outcome": "timeout"}]
    for episode, total in enumerate(totals.tolist(), 1):
        outcome = "goal" if total > 0 else "collision"
        rate = float(rates[episode - 1])
        lines.append({"episode": episode, "return": total, "outcome": outcome, "dcpa": 50.0, "epsilon": rate})
        if episode % every == 0 or episode == len(totals):
            lines.append(
                {"episode": episode, "greedy_return": total, "greedy_outcome": outcome, "greedy_dcpa": 60.0}
            )
    keys = ("episode", "epsilon", "return", "outcome", "dcpa")
    greedy = ("greedy_return", "greedy_outcome", "greedy_dcpa")
    with (place / "curve.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, (*keys, *greedy), restval="")
        writer.writeheader()
        writer.writerows(lines)
    values: dict[str, Any] = {
        "pair": pair,
        "arm": arm,
        "seed": seed,
        "config_hash": f"{pair}{arm}{seed}",
        "episodes": len(totals),
        "best_known_return": BEST,
        "random_return": RANDOM,
        "untrained": an_evaluation(RANDOM),
        "before": an_evaluation(first),
    }
    a_result(**values | changes).write(place)
    return place


def write_planned(folder: Path, seeds: int, episodes: int = 600, *overrides: str) -> int:
    """Write a run of each job of a whole study, pairs, reuse and controls; returns how many.

    Transfers learn sooner than what starts from scratch, controls as late, and one seed in five hardly.
    """
    jobs = plan_jobs(to_study(["profile=quick", f"seeds={seeds}", *overrides]))
    for k, job in enumerate(jobs):
        rng = np.random.default_rng([2022, k])
        arm = Arm.parse(job.arm)
        is_ahead = not arm.is_scratch and arm.weights is SourceWeights.learned
        # The whole network is ahead of all four conv layers.
        head_start = (
            0.4 + 0.1 * (5 if arm.layers == ALL_LAYERS else int(arm.layers or 0)) if is_ahead else 0.0
        )
        low = job.values.get("learn", {}).get("epsilon_start", 1.0)
        epsilon = np.maximum(1e-4, low * (1 - np.arange(episodes) / (0.6 * episodes)))
        end = rng.normal(0.92, 0.02) * (0.4 if rng.random() < 0.2 * (1 - head_start) else 1.0)
        half = 0.1 * episodes * (1.2 - head_start)
        scores = np.minimum(learning(rng, episodes, end, half) - 0.4 * epsilon * rng.random(episodes), 1.0)
        source = job.values.get("source")
        write_run(
            folder / job.part,
            scores,
            pair=job.label,
            arm=job.arm,
            seed=job.seed,
            epsilon=epsilon,
            every=max(1, episodes // 60),
            before=0.4 * head_start,
            source=None if source is None else str(source),
            target=str(job.values["target"]),
            draws=returns_of(rng.normal(0.4 * head_start, 0.05, 10)).tolist(),
        )
    return len(jobs)


def make_record(scores: NDArray[np.float64], part: str, pair: str, arm: str, seed: int) -> RunRecord:
    """A run that never was a file; one greedy evaluation an episode, and one before."""
    totals = returns_of(scores)
    parts = {
        TRAINING: (np.arange(1, len(scores) + 1), 0.1, totals, scores > 0.5),
        GREEDY: (
            np.arange(len(scores) + 1),
            np.nan,
            np.concatenate([returns_of(np.zeros(1)), totals]),
            np.concatenate([[False], scores > 0.5]),
        ),
    }
    rows = [
        pd.DataFrame({"kind": kind, "episode": episode, "epsilon": epsilon, "return": returns, "dcpa": 50.0})
        .assign(outcome=np.where(goal, "goal", "collision"))
        for kind, (episode, epsilon, returns, goal) in parts.items()
    ]  # fmt: skip
    made = a_result(pair=pair, arm=arm, seed=seed, source=None, before=an_evaluation(RANDOM))
    folder = Path(part, pair, arm)
    return replace(made, best_known_return=BEST, folder=folder, part=part, rows=pd.concat(rows))


def told(record: RunRecord, **changes: Any) -> RunRecord:
    """The same run with other fields of its result."""
    return replace(record, **changes)


def with_curve(record: RunRecord, kind: str, **columns: Any) -> RunRecord:
    """The same run with other columns of its training episodes or greedy evaluations."""
    rows = record.curve.copy()
    for name, values in columns.items():
        rows.loc[rows["kind"] == kind, name.removesuffix("s")] = values
    return replace(record, rows=rows)


def study_of(**arms: NDArray[np.float64]) -> Study:
    """Runs of pair high, each at one score throughout, by arm and seed."""
    return Study(
        {
            ("pairs", "high", arm, seed): make_record(np.full(40, score), "pairs", "high", arm, seed)
            for arm, scores in arms.items()
            for seed, score in enumerate(scores)
        },
        claims=MARGINS,
    )


def make_study(
    ends: Mapping[tuple[str, str, str], float], seeds: int = 15, sd: float = 0.02, episodes: int = 120
) -> Study:
    """Runs of each (part, pair, arm), which all learn towards the given score."""
    return learned(ends, dict.fromkeys(ends, 10.0), seeds, sd, episodes)


def ranked(merits: Mapping[tuple[str, str, str], float], seeds: int = 15) -> Study:
    """Runs that all learn their case; those of more merit are higher throughout, and sooner."""
    ends = {place: 0.75 + 0.2 * merit for place, merit in merits.items()}
    return learned(ends, {place: 30.0 * (1.2 - merit) for place, merit in merits.items()}, seeds, 0.004, 240)


def learned(
    ends: Mapping[tuple[str, str, str], float],
    halves: Mapping[tuple[str, str, str], float],
    seeds: int,
    sd: float,
    episodes: int,
) -> Study:
    """Runs by the score at their end, and by when they have learned half of it."""
    records = {}
    for k, (place, end) in enumerate(ends.items()):
        for seed in range(seeds):
            rng = np.random.default_rng([k, seed])
            scores = learning(rng, episodes, end + rng.normal(0, sd), halves[place], noise=0.02)
            records[(*place, seed)] = make_record(scores, *place, seed)
    return Study(records, claims=MARGINS)


def write_study(
    folder: Path,
    seeds: int,
    episodes: int = 60,
    pairs: tuple[str, ...] = ("high",),
    arms: tuple[str, ...] = ARMS,
    noise: float = 0.1,
) -> None:
    """Write runs of a study's pairs, of which each arm is better than the one before."""
    rng = np.random.default_rng(0)
    for pair in pairs:
        for k, arm in enumerate(arms):
            for seed in range(seeds):
                scores = learning(rng, episodes, 0.5 + 0.4 * k / len(arms), noise=noise)
                write_run(folder / "pairs", scores, pair=pair, arm=arm, seed=seed)
