"""The metrics of a run. Scores are returns scaled so that 0 is random actions, 1 the best known return."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.arm import Arm
from ship_trl.files.curve import moving_mean
from ship_trl.files.logs import LearningCurve
from ship_trl.files.record import RunRecord
from ship_trl.study.plan import LOW, ONE, REUSED_CASE

# The moving score is a mean over this share of the training episodes. A run reaches a threshold when the
# moving score first is at it; the first threshold is the primary one.
WINDOW, THRESHOLDS = 0.03, (0.65, 0.5, 0.8)
# The last tenth and the first fifth of the episodes.
LAST, EARLY = 0.1, 0.2
# A run has fallen back if it misses the goal in this many training episodes in a row after exploration.
FALLEN_EPISODES = 10
# Points along a curve of moving scores; more of them do not change its mean.
CURVE_POINTS = 100


def first(values: NDArray[Any], share: float = EARLY) -> NDArray[Any]:
    """Return the first share of some episodes, at least one."""
    return values[: count_share(values, share)]


def last(values: NDArray[Any], share: float = LAST) -> NDArray[Any]:
    """Return the last share of some episodes, at least one."""
    return values[-count_share(values, share) :]


def count_share(values: NDArray[Any], share: float) -> int:
    """Return how many episodes are a share of them, at least one."""
    return max(1, round(share * len(values)))


def mean(values: NDArray[Any]) -> float:
    """Return the mean of numbers, or the share of true values."""
    return float(np.mean(values))


def start(record: RunRecord) -> float:
    """Return the mean greedy score before training, over draws of the layers that are not copied."""
    return mean(record.score(np.array(record.draws or [record.before.episode_return])))


def moving_scores(record: RunRecord) -> NDArray[np.float64]:
    """Return the moving mean of the training scores, [E - window + 1]."""
    window = count_share(record.scores, WINDOW)
    return moving_mean(record.scores, window)[window - 1 :]


def curve(record: RunRecord) -> NDArray[np.float64]:
    """Return the moving score at `CURVE_POINTS` points, evenly along the run."""
    scores = moving_scores(record)
    return np.interp(np.linspace(0, len(scores) - 1, CURVE_POINTS), np.arange(len(scores)), scores)


def has_reached(record: RunRecord, threshold: float = THRESHOLDS[0]) -> bool:
    """Return whether the moving score ever reaches the threshold."""
    return bool(np.any(moving_scores(record) >= threshold))


def time_to_threshold(record: RunRecord, threshold: float = THRESHOLDS[0]) -> float:
    """Return the share of the training episodes until the moving score reaches the threshold; 1 if never.

    NaN without scores.
    """
    if math.isnan(record.best_known):
        return math.nan
    scores, total = moving_scores(record), len(record.training.returns)
    reached = np.flatnonzero(scores >= threshold)
    return float(total - len(scores) + 1 + reached[0]) / total if reached.size else 1.0


def total_time(record: RunRecord) -> float:
    """Return the time to the threshold with the episodes of all sources (Taylor and Stone, 2009).

    The network that figure 9 reuses was trained twice: on case 1, then on case 2.
    """
    source = record.source
    trained = source is not None and Arm.of_run(record.arm).has_trained_source
    trained_twice = record.part in (LOW, ONE) and source == REUSED_CASE
    return time_to_threshold(record) + trained + trained_twice


def around_exploration_end(record: RunRecord) -> tuple[slice, slice]:
    """Return the tenth of the episodes before exploration ends, and the tenth after.

    Without an epsilon, as in PPO, the last tenth counts as the one after.
    """
    count, tenth = len(record.training.returns), count_share(record.scores, LAST)
    ended = np.flatnonzero(record.training.epsilon <= record.training.epsilon.min())
    end = int(ended[0]) if ended.size else count - tenth
    return slice(max(0, end - tenth), max(1, end)), slice(min(end, count - 1), min(end + tenth, count))


def dip(record: RunRecord) -> float:
    """Return the largest fall of the moving score around the end of exploration.

    The score moves over a fortieth of the episodes, from two tenths before that end to two tenths after.
    Chance alone makes falls, so a dip is compared with scratch and not with zero.
    """
    scores = record.scores
    tenth, width = count_share(scores, LAST), count_share(scores, LAST / 4)
    end = around_exploration_end(record)[0].stop
    near = scores[max(0, end - 2 * tenth) : end + 2 * tenth]
    means = moving_mean(near, width)[width - 1 :]
    return float(np.max(np.maximum.accumulate(means) - means))


def collision_rise(record: RunRecord) -> float:
    """Return the rise of the share of collisions from the tenth before exploration ends to the one after."""
    before, after = around_exploration_end(record)
    return mean(record.training.collision[after]) - mean(record.training.collision[before])


def late_misses(record: RunRecord) -> NDArray[np.bool_]:
    """Return which training episodes after exploration miss the goal; there is at least one episode."""
    return ~record.training.goal[around_exploration_end(record)[1].start :]


def fell(record: RunRecord) -> float:
    """Return 1 if `FALLEN_EPISODES` training episodes in a row miss the goal after exploration, else 0.

    A run that never reached the goal counts too; `has_reached` tells them apart.
    """
    longest = row = 0
    for is_miss in late_misses(record):
        row = row + 1 if is_miss else 0
        longest = max(longest, row)
    return float(longest >= FALLEN_EPISODES)


# The metrics by their names in the report.
METRICS: dict[str, Callable[[RunRecord], float]] = {
    # The mean score of all training episodes: the area under the learning curve.
    "area": lambda run: mean(run.scores),
    "time": time_to_threshold,
    **{f"time to {level}": partial(time_to_threshold, threshold=level) for level in sorted(THRESHOLDS[1:])},
    "total time": total_time,
    "asymptote": lambda run: mean(last(run.scores)),
    "early area": lambda run: mean(first(run.scores)),
    "start": start,
    "greedy area": lambda run: mean(run.score(run.greedy.returns)),
    "greedy asymptote": lambda run: mean(run.score(last(run.greedy.returns))),
    # Of the best greedy evaluation.
    "best": lambda run: float(np.max(run.score(run.greedy.returns))),
    "fell": fell,
    # The share of the training episodes after exploration that do not end at the goal.
    "misses": lambda run: mean(late_misses(run)),
    # The share of the last tenth of the training episodes that end at the goal.
    "success": lambda run: mean(last(run.training.goal)),
    # The share of the last tenth of the greedy evaluations that end at the goal.
    "greedy success": lambda run: mean(last(run.greedy.goal)),
    "collisions": lambda run: mean(run.training.collision),
    "early collisions": lambda run: mean(first(run.training.collision)),
    "dip": dip,
    "collision rise": collision_rise,
    # The least distance (m) to a target ship in the last greedy episode; NaN without ships.
    "least distance": lambda run: float(run.greedy.dcpa[-1]),
    # The source network's score on its case less that of the network at the end; NaN if not measured.
    "forgetting": lambda run: math.nan if (on := run.on_source) is None else on.forgetting,
}
# Metrics that came after studies were kept. Reports have them if a run measured its source, so that those of
# older studies stay as they are.
LATER = ("greedy success", "forgetting")
# Metrics for which less is better.
TIMES = ("time", "time to 0.5", "time to 0.8", "total time")


def metrics_of(records: Iterable[RunRecord]) -> list[str]:
    """Return the names of the metrics that tables of these runs have, see `LATER`."""
    is_later = any(math.isfinite(measure(record, "forgetting")) for record in records)
    return [name for name in METRICS if is_later or name not in LATER]


def measure(record: RunRecord, name: str) -> float:
    """Return a metric of a run, computed once."""
    if name not in record.measured:
        record.measured[name] = METRICS[name](record)
    return record.measured[name]


# Metrics of learning curves of any library (Taylor and Stone, 2009): all arms on the steps that all have.
# Parts of the steps, in each of which returns are averaged.
POINTS = 200
Floats = NDArray[np.float64]


def moving_returns(curves: Sequence[LearningCurve], steps: float) -> Floats:
    """Return moving returns [runs, POINTS] in the first steps; a return holds for the steps before it."""
    window = np.ones(max(1, round(WINDOW * POINTS)))
    # The mean of the parts up to half a window to either side, fewer at the ends.
    weights, moving = np.convolve(np.ones(POINTS), window, "same"), []
    for one in curves:
        ends = np.concatenate(([0.0], one.steps))
        total = np.concatenate(([0.0], np.cumsum(np.diff(ends) * one.returns)))
        parts = np.diff(np.interp(np.linspace(0.0, steps, POINTS + 1), ends, total)) * POINTS / steps
        moving.append(np.convolve(parts, window, "same") / weights)
    return np.array(moving)


def measure_curves(curves: Sequence[LearningCurve], scores: Floats, threshold: float) -> dict[str, Floats]:
    """Return each metric of curves, [runs], from their moving scores [runs, POINTS]; NaN if not measured.

    `time` is the share of the steps until the threshold is reached, 1 if it never is.
    """
    reached = scores >= threshold
    rates = [mean(last(one.success_rates)) if one.success_rates.size else math.nan for one in curves]
    return {
        "start": first(scores.T, WINDOW).mean(0),
        "early area": first(scores.T, EARLY).mean(0),
        "area": scores.mean(1),
        "time": np.where(reached.any(1), (reached.argmax(1) + 0.5) / POINTS, 1.0),
        "asymptote": last(scores.T, LAST).mean(0),
        "greedy success": np.array(rates),
        "forgetting": np.array([one.forgetting for one in curves]),
    }


def find_scale(curves: Iterable[LearningCurve], moving: Floats) -> tuple[float, float]:
    """Return the returns that score 0 and 1, as `RunRecord.score`: of random actions, and the best known.

    If no runs of one target say both, they are the least and the largest moving return of any run.
    """
    known = {one.known for one in curves if one.known is not None}
    if len(known) == 1:
        return known.pop()
    low, high = float(moving.min()), float(moving.max())
    return low, high if high > low else low + 1.0
