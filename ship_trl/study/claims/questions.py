"""What somebody asks of a study, in the words of the report: `low: FE3 above FE4 (asymptote)`, `low: FE3`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from ship_trl.config.errors import ConfigError
from ship_trl.study.analysis.metrics import METRICS, TIMES
from ship_trl.study.analysis.study import Place, Study
from ship_trl.study.claims.kinds import REUSED, Test, joined, weighted
from ship_trl.study.plan.config import NEW_CASE
from ship_trl.study.plan.jobs import COMPARED, CONTROLS, PAIRS, from_scratch

FORM = "WHERE: ARM above ARM (METRIC), of times ARM sooner than ARM, or WHERE: ARM (METRIC)"
EVERY_PAIR, EVERY_ARM, MEAN = "every pair", "every arm", "mean of "
ABOVE, SOONER = "above", "sooner than"
QUESTION = re.compile(rf"([^:]+?) ?: ?(.+?)(?: ({ABOVE}|{SOONER}) (.+?))?(?: \(([^()]+)\))?")


def places_of(study: Study) -> dict[str, dict[str, Place]]:
    """Return where the runs of each arm lie, by a pair's name or by `source to target`.

    Of a pair its controls are arms too; of what is no pair (a case to itself, a control's source) those
    from scratch are its target's. The new case has the names that the report gives its networks.
    """
    found: dict[str, dict[str, Place]] = {}
    places = sorted({key[:3] for key in study.records})
    for kind in (PAIRS, CONTROLS):
        for part, label, arm in places:
            if part == kind and not (part == CONTROLS and label in COMPARED):
                found.setdefault(label, {})[arm] = (part, label, arm)
    for label in COMPARED:
        arms = {key[2] for key in study.records if key[:2] == (CONTROLS, label)}
        if arms:
            record = next(iter(study.arm(CONTROLS, label, min(arms)).values()))
            own: dict[str, Place] = {arm: (CONTROLS, label, arm) for arm in sorted(arms)}
            scratch = from_scratch(CONTROLS, label)
            found[f"{record.source} to {record.target}"] = (
                {"scratch": scratch, **own} if study.arm(*scratch) else own
            )
    reused = {name: place for name, place in REUSED.items() if study.arm(*place)}
    return {**found, NEW_CASE: reused} if reused else found


def ask(study: Study, question: str) -> list[Test]:
    """Make the tests of a question: one, or one for `every pair` and `every arm`.

    Without a second arm it is the first one's level. Of a time the smaller is the better, so that arms are
    `sooner than` others, and not above them. An arm of elsewhere is `ARM of WHERE`; it must have the same
    target, for else the scores are of two cases.

    Raises:
        ConfigError: the question has another form, or names what the study has not.
    """
    match = QUESTION.fullmatch(" ".join(question.split()))
    if match is None:
        raise ConfigError(f"question: got {question!r}; allowed: {FORM}")
    where, better, word, worse, metric = match.groups()
    metric = metric or "area"
    known = places_of(study)
    if metric not in METRICS:
        raise ConfigError(f"question: no metric {metric!r}; allowed: {', '.join(METRICS)}")
    right = SOONER if metric in TIMES else ABOVE
    if word not in (None, right):
        raise ConfigError(f"question: {metric} is asked for by {right!r}, got {word!r}")
    if EVERY_ARM in f"{worse}":
        raise ConfigError(f"question: {EVERY_ARM!r} stands on the right; allowed: on the left")
    pairs = [name for name in known if name in {key[1] for key in study.records if key[0] == PAIRS}]
    if where not in known and where != EVERY_PAIR:
        raise ConfigError(f"question: nothing of {where!r}; allowed: {EVERY_PAIR}, {', '.join(known)}")
    if where == EVERY_PAIR and not pairs:
        raise ConfigError(f"question: the study has no pair; allowed: {', '.join(known)}")
    return [
        test
        for place in (pairs if where == EVERY_PAIR else [where])
        for test in of_place(study, known, place, (better, word, worse), metric)
    ]


def of_place(
    study: Study,
    known: Mapping[str, Mapping[str, Place]],
    where: str,
    words: tuple[str, str | None, str | None],
    metric: str,
) -> Iterator[Test]:
    """Make the tests of one pair, or of what stands in its place."""
    better, word, worse = words
    others = {} if worse is None else side(study, known, where, worse)
    compared = set(others.values())
    every = [name for name, place in known[where].items() if place not in compared]
    for name in every if better == EVERY_ARM else [better]:
        arms = side(study, known, where, name)
        if set(arms.values()) == compared:
            raise ConfigError(f"question: {name!r} stands on both sides; allowed: two arms")
        weights = {arm: 1 / len(arms) for arm in arms}
        for arm in others:
            weights[arm] = weights.get(arm, 0.0) - 1 / len(others)
        told = joined([*arms])
        if others:
            told += f" {word} {joined([*others])}"
        elif metric in TIMES:
            # A level has the sign that it has; `weighted` turns that of times round.
            weights = {arm: -weight for arm, weight in weights.items()}
        try:
            yield weighted(where, told, {**arms, **others}, weights, metric)
        except ValueError as error:
            # An arm of the study's own, which no claim could name either.
            raise ConfigError(f"question: {error}") from None


def side(study: Study, known: Mapping[str, Mapping[str, Place]], where: str, words: str) -> dict[str, Place]:
    """Read the arms of one side: `ARM`, `ARM of WHERE`, or `mean of ARM, ARM`.

    Raises:
        ConfigError: the study has no such arm there, or it has another target.
    """
    many = words.startswith(MEAN)
    # Some names have a comma in them.
    names = list_of(words.removeprefix(MEAN), [*known[where]]) if many else [words]
    if not names:
        raise ConfigError(f"question: {MEAN.strip()!r} names no arm; allowed: {MEAN}ARM, ARM")
    found: dict[str, Place] = {}
    for name in names:
        arm, _, elsewhere = name.partition(" of ")
        place = known.get(elsewhere or where, {}).get(arm)
        if place is None:
            allowed = f"{' | '.join(known[where])}, and ARM of {' | '.join(known)}"
            raise ConfigError(f"question: no arm {name!r} in {where}; allowed: {allowed}; the form is {FORM}")
        here, there = (target_of(study, one) for one in (next(iter(known[where].values())), place))
        if here != there:
            raise ConfigError(
                f"question: {name!r} has the target {there}, and {where} {here}; allowed: the same"
            )
        found[name] = place
    return found


def list_of(words: str, names: Sequence[str]) -> list[str]:
    """Split a list at its commas, but not within the names that have one."""
    longest_first = "|".join(sorted(map(re.escape, names), key=len, reverse=True))
    # A name, or one of elsewhere, up to the next comma; and what is neither, for it is to be named.
    return re.findall(rf"(?:^|, *)((?:{longest_first})(?: of [^,]+)?(?=,|$)|[^,]+)", words)


def target_of(study: Study, place: Place) -> str:
    """Return the target of an arm's runs."""
    return next(iter(study.arm(*place).values())).target
