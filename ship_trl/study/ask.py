"""Contrasts asked for in the words of the report: `low: FE3 above FE4 (asymptote)`, `low: FE3`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from ship_trl.config.errors import ConfigError
from ship_trl.study.compare import Contrast, comparative, joined, mean_difference, weighted
from ship_trl.study.metrics import METRICS, TIMES
from ship_trl.study.plan import Place
from ship_trl.study.study import Study, pairs, places_of

FORM = "WHERE: ARM above ARM (METRIC); for times WHERE: ARM sooner than ARM (METRIC); or WHERE: ARM (METRIC)"
EVERY_PAIR, EVERY_ARM, MEAN = "every pair", "every arm", "mean of "
QUESTION = re.compile(r"([^:]+?) ?: ?(.+?)(?: (above|sooner than) (.+?))?(?: \(([^()]+)\))?")
# Places by arm, by the name of a pair.
Known = Mapping[str, Mapping[str, Place]]


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
        names = split_names(words.removeprefix(MEAN), [*known[where]])
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


def split_names(words: str, names: Sequence[str]) -> list[str]:
    """Split a list at its commas, but not inside names that contain one."""
    longest_first = "|".join(sorted(map(re.escape, names), key=len, reverse=True))
    # A known name up to the next comma, or else any words, which the caller refuses by name.
    return re.findall(rf"(?:^|, *)((?:{longest_first})(?: of [^,]+)?(?=,|$)|[^,]+)", words)


def target_of(study: Study, place: Place) -> str:
    """Return the target of an arm's runs."""
    return next(iter(study.arm(*place).values())).target
