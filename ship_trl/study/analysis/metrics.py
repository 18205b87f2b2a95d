"""What is measured of a run, as a score: 0 is random actions, 1 the best return known."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ship_trl.files.curve import moving_mean
from ship_trl.study.plan.config import REUSED_CASE
from ship_trl.study.plan.jobs import LOW, ONE
from ship_trl.study.records.record import Record

# The first mean of so large a share of the training episodes at the threshold or above counts as having
# got there; the first threshold is the primary one.
WINDOW, THRESHOLDS = 0.03, (0.65, 0.5, 0.8)
LAST, EARLY = 0.1, 0.2
# A run has fallen back if, exploration over, so many training episodes in a row miss the goal.
FALLEN = 10
# Along a curve of moving scores; more places do not change its mean.
PLACES = 100


def share(record: Record, part: float) -> int:
    """So many of a run's episodes, at least one."""
    return max(1, round(part * len(record.training.returns)))


def area(record: Record) -> float:
    """Area under the training-return curve: the mean score of all training episodes."""
    return float(np.mean(record.score(record.training.returns)))


def early_area(record: Record) -> float:
    """Return the mean score of the first fifth of the training episodes."""
    return float(np.mean(record.score(record.training.returns[: share(record, EARLY)])))


def asymptote(record: Record) -> float:
    """Return the mean score of the last tenth of the training episodes."""
    return float(np.mean(record.score(record.training.returns[-share(record, LAST) :])))


def greedy_area(record: Record) -> float:
    """Return the mean score of all greedy evaluations."""
    return float(np.mean(record.score(record.greedy.returns)))


def greedy_asymptote(record: Record) -> float:
    """Return the mean score of the last tenth of the greedy evaluations."""
    count = max(1, round(LAST * len(record.greedy.returns)))
    return float(np.mean(record.score(record.greedy.returns[-count:])))


def start(record: Record) -> float:
    """Return the mean greedy score before training, over draws of the layers that are not copied."""
    draws = record.draws if len(record.draws) else np.array([record.before])
    return float(np.mean(record.score(draws)))


def best(record: Record) -> float:
    """Return the score of the best greedy evaluation."""
    return float(np.max(record.score(record.greedy.returns)))


def success(record: Record) -> float:
    """Share of the last tenth of the training episodes that end at the goal."""
    return float(np.mean(record.training.goal[-share(record, LAST) :]))


def collisions(record: Record) -> float:
    """Share of all training episodes that end in a collision."""
    return float(np.mean(record.training.collision))


def early_collisions(record: Record) -> float:
    """Share of the first fifth of the training episodes that end in a collision."""
    return float(np.mean(record.training.collision[: share(record, EARLY)]))


def smallest_dcpa(record: Record) -> float:
    """Return the least distance (m) to a target ship in the last greedy episode; NaN without ships."""
    return float(record.greedy.dcpa[-1])


def moving_scores(record: Record) -> NDArray[np.float64]:
    """Mean scores of `WINDOW` of the training episodes in a row: [E - window + 1]."""
    window = share(record, WINDOW)
    return moving_mean(record.score(record.training.returns), window)[window - 1 :]


def curve(record: Record) -> NDArray[np.float64]:
    """Return moving scores at `PLACES` places, evenly along the run."""
    scores = moving_scores(record)
    return np.interp(np.linspace(0, len(scores) - 1, PLACES), np.arange(len(scores)), scores)


def reached(record: Record, threshold: float = THRESHOLDS[0]) -> bool:
    """Whether the moving score ever is at the threshold."""
    return bool(np.any(moving_scores(record) >= threshold))


def time_to_threshold(record: Record, threshold: float = THRESHOLDS[0]) -> float:
    """Share of the training episodes until the moving score first is at the threshold.

    Of a run that never is, all of them: time is restricted to the length of a run.
    """
    scores, total = moving_scores(record), len(record.training.returns)
    there = np.flatnonzero(scores >= threshold)
    return float(total - len(scores) + 1 + there[0]) / total if there.size else 1.0


def total_time(record: Record) -> float:
    """Return the same with the episodes counted on which its sources were trained (Taylor and Stone, 2009).

    The network that figure 9 reuses was trained twice: on case 1, and then on case 2.
    """
    trained = record.source is not None and not record.arm.endswith("-random")
    twice = record.part in (LOW, ONE) and record.source == REUSED_CASE
    return time_to_threshold(record) + trained + twice


def around_annealed(record: Record) -> tuple[slice, slice]:
    """Return the tenth of the episodes before exploration has ended, and the one after."""
    count = len(record.training.returns)
    ended = np.flatnonzero(record.training.epsilon <= record.training.epsilon.min())
    end, tenth = int(ended[0]) if ended.size else count, share(record, LAST)
    return slice(max(0, end - tenth), max(1, end)), slice(min(end, count - 1), min(end + tenth, count))


def dip(record: Record) -> float:
    """Return the largest fall of the moving score around the end of exploration: peak less trough after it.

    From two tenths of the episodes before that end to two after; the mean is over a fortieth. Chance alone
    makes falls, so that arms are compared with scratch and not with zero.
    """
    scores = record.score(record.training.returns)
    tenth, width = share(record, LAST), share(record, LAST / 4)
    end = around_annealed(record)[0].stop
    near = scores[max(0, end - 2 * tenth) : end + 2 * tenth]
    means = moving_mean(near, width)[width - 1 :]
    return float(np.max(np.maximum.accumulate(means) - means))


def collision_rise(record: Record) -> float:
    """How much the share of collisions rises between the same tenths."""
    before, after = around_annealed(record)
    return float(np.mean(record.training.collision[after]) - np.mean(record.training.collision[before]))


def after_exploration(record: Record) -> slice:
    """Return the training episodes after exploration has ended; the last one at least."""
    end = around_annealed(record)[1].start
    return slice(end, None)


def misses(record: Record) -> float:
    """Share of the training episodes after exploration that do not end at the goal."""
    return float(np.mean(~record.training.goal[after_exploration(record)]))


def fell(record: Record) -> float:
    """1 if, exploration over, `FALLEN` training episodes in a row do not end at the goal, else 0.

    It may have been at the goal before, or never: `reached` tells.
    """
    longest = row = 0
    for goal in record.training.goal[after_exploration(record)]:
        row = 0 if goal else row + 1
        longest = max(longest, row)
    return float(longest >= FALLEN)


# Everything of a run that is one number, by the report's names.
METRICS: dict[str, Callable[[Record], float]] = {
    "area": area,
    "time": time_to_threshold,
    **{f"time to {level}": partial(time_to_threshold, threshold=level) for level in sorted(THRESHOLDS[1:])},
    "total time": total_time,
    "asymptote": asymptote,
    "early area": early_area,
    "start": start,
    "greedy area": greedy_area,
    "greedy asymptote": greedy_asymptote,
    "best": best,
    "fell": fell,
    "misses": misses,
    "success": success,
    "collisions": collisions,
    "early collisions": early_collisions,
    "dip": dip,
    "collision rise": collision_rise,
    "DCPA": smallest_dcpa,
}
# Less is better of these.
TIMES = ("time", "time to 0.5", "time to 0.8", "total time")


def measure(record: Record, name: str) -> float:
    """Return a metric of a run, which is computed once."""
    if name not in record.measured:
        record.measured[name] = METRICS[name](record)
    return record.measured[name]
