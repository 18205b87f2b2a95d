"""What is measured of a run, as a score: 0 is random actions, 1 the best return known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ship_trl.study.records import Record

# The first mean of so many training episodes at the threshold or above counts as having got there.
WINDOW, THRESHOLD = 100, 0.8
LAST, EARLY = 0.1, 0.2


def share(record: Record, part: float) -> int:
    """So many of a run's episodes, at least one."""
    return max(1, round(part * len(record.training.total)))


def area(record: Record) -> float:
    """Area under the training-return curve: the mean score of all training episodes."""
    return float(np.mean(record.score(record.training.total)))


def early_area(record: Record) -> float:
    """The mean score of the first fifth of the training episodes."""
    return float(np.mean(record.score(record.training.total[: share(record, EARLY)])))


def late_gain(record: Record) -> float:
    """How much higher the last tenth of the training episodes scores than the middle fifth."""
    scores = record.score(record.training.total)
    count = len(scores)
    middle = scores[int(0.4 * count) : max(int(0.6 * count), int(0.4 * count) + 1)]
    return float(np.mean(scores[-share(record, LAST) :]) - np.mean(middle))


def asymptote(record: Record) -> float:
    """The mean score of the last tenth of the training episodes."""
    return float(np.mean(record.score(record.training.total[-share(record, LAST) :])))


def greedy_area(record: Record) -> float:
    """The mean score of all greedy evaluations."""
    return float(np.mean(record.score(record.greedy.total)))


def greedy_asymptote(record: Record) -> float:
    """The mean score of the last tenth of the greedy evaluations."""
    count = max(1, round(LAST * len(record.greedy.total)))
    return float(np.mean(record.score(record.greedy.total[-count:])))


def jumpstart(record: Record) -> float:
    """How much more the greedy policy scores before training than that of the same network untransferred."""
    return float(record.score(record.before) - record.score(record.scratch))


def best(record: Record) -> float:
    """The score of the best greedy evaluation."""
    return float(np.max(record.score(record.greedy.total)))


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
    """The least distance (m) to a target ship in the last greedy episode; not a number without ships."""
    return float(record.greedy.dcpa[-1])


def moving_scores(record: Record, window: int = WINDOW) -> NDArray[np.float64]:
    """Mean scores of `window` training episodes in a row (all, where there are fewer): [E - window + 1]."""
    scores = record.score(record.training.total)
    window = min(window, len(scores))
    sums = np.concatenate([[0.0], np.cumsum(scores)])
    return (sums[window:] - sums[:-window]) / window


def time_to_threshold(record: Record) -> tuple[float, bool]:
    """Episodes until the moving score first reaches the threshold, and whether it does.

    Of a run that never does, all its episodes: it is censored there.
    """
    scores = moving_scores(record)
    reached = np.flatnonzero(scores >= THRESHOLD)
    total = len(record.training.total)
    return (float(total - len(scores) + 1 + reached[0]), True) if reached.size else (float(total), False)


def around_annealed(record: Record) -> tuple[slice, slice]:
    """The tenth of the episodes before exploration has ended, and the one after."""
    count = len(record.training.total)
    ended = np.flatnonzero(record.training.epsilon <= record.training.epsilon.min())
    end, tenth = int(ended[0]) if ended.size else count, share(record, LAST)
    return slice(max(0, end - tenth), max(1, end)), slice(min(end, count - 1), min(end + tenth, count))


def dip(record: Record) -> float:
    """The largest fall of the moving score around the end of exploration: a peak less the trough after it.

    From two tenths of the episodes before that end to two after; the mean is over a fortieth. Chance alone
    makes falls, so that arms are compared with scratch and not with zero.
    """
    scores = record.score(record.training.total)
    tenth, width = share(record, LAST), share(record, LAST / 4)
    end = around_annealed(record)[0].stop
    near = scores[max(0, end - 2 * tenth) : end + 2 * tenth]
    sums = np.concatenate([[0.0], np.cumsum(near)])
    means = (sums[width:] - sums[:-width]) / width
    return float(np.max(np.maximum.accumulate(means) - means))


def collision_rise(record: Record) -> float:
    """How much the share of collisions rises between the same tenths."""
    before, after = around_annealed(record)
    return float(np.mean(record.training.collision[after]) - np.mean(record.training.collision[before]))


# Everything of a run that is one number, by the report's names.
METRICS: dict[str, Callable[[Record], float]] = {
    "area": area,
    "early area": early_area,
    "late gain": late_gain,
    "asymptote": asymptote,
    "greedy area": greedy_area,
    "greedy asymptote": greedy_asymptote,
    "jumpstart": jumpstart,
    "best": best,
    "success": success,
    "collisions": collisions,
    "early collisions": early_collisions,
    "dip": dip,
    "collision rise": collision_rise,
    "DCPA": smallest_dcpa,
}
