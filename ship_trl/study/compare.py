"""Compare arms: contrasts within each seed, also in words, gains over scratch, and forward transfer.

The words are those of the report: `low: FE3 above FE4 (asymptote)`, or `low: FE3` for a level.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ship_trl.config.errors import ConfigError
from ship_trl.study.metrics import METRICS, TIMES, measure
from ship_trl.study.plan import Place
from ship_trl.study.statistics import Estimate, Sample, estimate_mean, welch
from ship_trl.study.study import Places, Study, pairs, places_of

# With fewer seeds no interval is shown of an arm: two or three cannot show how seeds vary.
MIN_SEEDS = 5
# The seed of all resampling, so that the same study gives the same report.
SEED = 2022
# Further metrics reported beside a metric.
SENSITIVITY = {
    "area": ("greedy area",),
    "asymptote": ("greedy asymptote",),
    "time": ("time to 0.5", "time to 0.8"),
}

FORM = "WHERE: ARM above ARM (METRIC); for times WHERE: ARM sooner than ARM (METRIC); or WHERE: ARM (METRIC)"
EVERY_PAIR, EVERY_ARM, MEAN = "every pair", "every arm", "mean of "
QUESTION = re.compile(r"([^:]+?) ?: ?(.+?)(?: (above|sooner than) (.+?))?(?: \(([^()]+)\))?")
# Places by arm, by the name of a pair.
Known = Mapping[str, Mapping[str, Place]]


@dataclass(frozen=True)
class Contrast:
    """A sum of arms with `weights` within each seed, in a metric; `what` says it in words."""

    what: str
    metric: str
    places: Places
    weights: Mapping[str, float]

    def measure(self, study: Study) -> Estimate | None:
        """Return the interquartile mean over seeds at the study's level; None below two common seeds."""
        runs = study.matched(self.places)
        if min(map(len, runs.values()), default=0) < 2:
            return None

        def differences(metric: str) -> Sample:
            parts = [
                share * np.array([measure(run, metric) for run in runs[name]])
                for name, share in self.weights.items()
            ]
            return np.sum(parts, axis=0)

        values = differences(self.metric)
        others = SENSITIVITY.get(self.metric, ())
        return replace(
            estimate_mean(values, study.level),
            what=self.what,
            metric=self.metric,
            differences=tuple(map(float, values)),
            beside={name: estimate_mean(differences(name), study.level) for name in others},
        )


def comparative(metric: str) -> str:
    """Return the word for the better side of a contrast."""
    return "sooner than" if metric in TIMES else "above"


def joined(arms: Sequence[str]) -> str:
    """Name some arms as one side of a contrast."""
    return arms[0] if len(arms) == 1 else f"mean of {', '.join(arms)}"


def mean_difference(better: Sequence[str], worse: Sequence[str]) -> dict[str, float]:
    """Return the weights of the mean of some arms less the mean of others."""
    weights = dict.fromkeys(better, 1 / len(better))
    for arm in worse:
        weights[arm] = weights.get(arm, 0.0) - 1 / len(worse)
    return weights


def weighted(where: str, what: str, places: Places, weights: Mapping[str, float], metric: str) -> Contrast:
    """Make a contrast of a weighted sum of arms, with the opposite sign for times, where less is better."""
    if metric not in METRICS:
        raise ValueError(f"{where}, {what}: no metric {metric}; allowed: {', '.join(METRICS)}")
    sign = -1.0 if metric in TIMES else 1.0
    signed = {name: sign * weight for name, weight in weights.items()}
    return Contrast(f"{where}: {what} ({metric})", metric, {name: places[name] for name in weights}, signed)


def gain(study: Study, place: Place, scratch: Place, metric: str = "area") -> Estimate | None:
    """Return how much an arm is above scratch, at the study's level; None without common seeds."""
    runs = study.matched({"arm": place, "scratch": scratch})
    arm, other = (np.array([measure(run, metric) for run in runs[name]]) for name in ("arm", "scratch"))
    return estimate_mean(arm - other, study.level) if len(arm) else None


def forward_transfer(area: Sample, baseline: Sample, paired: bool = False) -> Estimate:
    """Return (area - baseline's) / (1 - baseline's), by mean areas (Continual World; Wolczyk et al., 2021).

    1 is all that could be gained, 0 nothing; NaN where the baseline leaves nothing to gain. The 95 % interval
    is Student's, or Welch's unless run k of both is `paired` by its seed, of the ratio's linear part in the
    two means (the delta method).
    """
    left = 1.0 - float(baseline.mean())
    if left <= 0:
        return Estimate(np.nan, np.nan, np.nan)
    value = float(area.mean() - baseline.mean()) / left
    # The ratio's derivatives by the mean areas are 1 / left and -(1 - value) / left.
    own, other = area / left, (1.0 - value) * baseline / left
    return welch(value, [own - other] if paired else [own, other])


def ask(study: Study, question: str) -> list[Contrast]:
    """Make the contrasts of a question: one, or one for each of `every pair` and `every arm`.

    Without a second arm a contrast is the level of the first. `ARM of WHERE` is an arm of another pair
    with the same target; scores of two targets cannot be compared.

    Raises:
        ConfigError: the question has another form, or names something that the study does not have.
    """
    match = QUESTION.fullmatch(" ".join(question.split()))
    if match is None:
        raise ConfigError(f"question: got {question!r}; allowed: {FORM}")
    where, better, word, worse, metric = match.groups()
    metric = metric or "area"
    known = places_of(study)
    if metric not in METRICS:
        raise ConfigError(f"question: no metric {metric!r}; allowed: {', '.join(METRICS)}")
    if word not in (None, comparative(metric)):
        raise ConfigError(f"question: {metric} takes {comparative(metric)!r}, got {word!r}")
    if where not in known and where != EVERY_PAIR:
        raise ConfigError(f"question: no runs of {where!r}; allowed: {EVERY_PAIR}, {', '.join(known)}")
    asked = [name for name in known if name in pairs(study)] if where == EVERY_PAIR else [where]
    if not asked:
        raise ConfigError(f"question: the study has no pair; allowed: {', '.join(known)}")
    return [one for name in asked for one in contrasts_of(study, known, name, (better, word, worse), metric)]


def contrasts_of(
    study: Study, known: Known, where: str, words: tuple[str, str | None, str | None], metric: str
) -> Iterator[Contrast]:
    """Make the contrasts of one pair."""
    better, word, worse = words
    others = {} if worse is None else read_side(study, known, where, worse)
    compared = set(others.values())
    every = [name for name, place in known[where].items() if place not in compared]
    for name in every if better == EVERY_ARM else [better]:
        arms = read_side(study, known, where, name)
        if set(arms.values()) == compared:
            raise ConfigError(f"question: {name!r} stands on both sides; allowed: two arms")
        weights = mean_difference([*arms], [*others])
        what = joined([*arms])
        if others:
            what += f" {word} {joined([*others])}"
        elif metric in TIMES:
            # `weighted` changes the sign of times, but a level must keep its own.
            weights = {arm: -weight for arm, weight in weights.items()}
        yield weighted(where, what, {**arms, **others}, weights, metric)


def read_side(study: Study, known: Known, where: str, words: str) -> dict[str, Place]:
    """Read the arms of one side: `ARM`, `ARM of WHERE`, or `mean of ARM, ARM`; all have one target."""
    names = [words]
    if words.startswith(MEAN):
        # A known name up to the next comma, also one that contains commas, or else any words.
        longest_first = "|".join(sorted(map(re.escape, known[where]), key=len, reverse=True))
        listed = rf"(?:^|, *)((?:{longest_first})(?: of [^,]+)?(?=,|$)|[^,]+)"
        names = re.findall(listed, words.removeprefix(MEAN))
    if not names:
        raise ConfigError(f"question: {MEAN.strip()!r} names no arm; allowed: {MEAN}ARM, ARM")
    found: dict[str, Place] = {}
    for name in names:
        arm, _, elsewhere = name.partition(" of ")
        place = known.get(elsewhere or where, {}).get(arm)
        if place is None:
            allowed = f"{' | '.join(known[where])}, and ARM of {' | '.join(known)}"
            raise ConfigError(f"question: no arm {name!r} in {where}; allowed: {allowed}; the form is {FORM}")
        target, wanted = target_of(study, place), target_of(study, next(iter(known[where].values())))
        if target != wanted:
            raise ConfigError(f"question: {name!r} has target {target}; allowed: target {wanted}, as {where}")
        found[name] = place
    return found


def target_of(study: Study, place: Place) -> str:
    """Return the target of an arm's runs."""
    return next(iter(study.arm(*place).values())).target
