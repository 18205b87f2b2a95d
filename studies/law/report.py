"""Tables, picture and coefficients of the law of transfer; plan.md has the rules, README.md is the page."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from itertools import permutations
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn import config_context
from sklearn.linear_model import LinearRegression

from ship_trl.config.arm import SCRATCH
from ship_trl.files.disk import atomic_write
from ship_trl.study.report.tables import write_csv
from ship_trl.study.statistics import Estimate
from ship_trl.transfer.law import ARM, FILE, ZERO_SHOT
from studies.law.choose import (
    HINDSIGHT,
    MOST,
    ONLY_SETS,
    PUBLISHED,
    RANDOM,
    Rule,
    all_regrets,
    make_all_rules,
    pick,
)
from studies.law.data import OF_SOURCE, Data, Floats, read
from studies.law.model import (
    CASES_ONLY,
    LAW_RULE,
    MODELS,
    NULL,
    ON_COMMAND,
    Model,
    ceiling,
    draws,
    explained,
    explained_draws,
    interval,
)
from studies.sources.judge import by_target

FOLDER, PAGE = Path("outputs/law"), Path(__file__).parent / "README.md"
TABLES = PAGE.with_name("tables.md")
SHOWN_SIZE, BOUND, SHARE, LEVEL = 3, 0.02, 0.75, 0.9
THRESHOLD = 0.65
Regrets = Mapping[tuple[str, int, bool], Floats]
Rows = list[Sequence[object]]


def report() -> None:
    """Write the page's blocks, its tables and picture, and the coefficients of the command."""
    with config_context(assume_finite=True, skip_parameter_validation=True):
        data = read("numbers")
        arms = list(data.gains)
        gains, at = np.stack([each.mean(0) for each in data.gains.values()]), arms.index(ARM)
        models = {name: Model(data.columns(), columns, gains) for name, columns in MODELS.items()}
        by_arm = {name: model.new_cases() for name, model in models.items()}
        both = {name: each[at] for name, each in by_arm.items()}
        targets = {name: model.new_targets()[at] for name, model in models.items()}
        rules = make_all_rules(data)
        regrets = all_regrets(data.gains[ARM], rules)
        errors = {name: pick_errors(data, models[name], at) for name in (CASES_ONLY, ON_COMMAND)}
        write_laws(models, errors, data, at)
        pixels = from_pixels(models[ON_COMMAND], read("pixels"), data, at)
    tests = [*test_table(data, both, regrets), calibration(errors[ON_COMMAND]), pixels]
    text = PAGE.read_text()
    for name, rows in {"tests": tests, "regrets": regret_table(regrets)}.items():
        text = re.sub(
            rf"(<!-- begin: {name} -->\n).*?(<!-- end -->)",
            lambda mark, rows=rows: mark[1] + markdown(rows) + mark[2],  # type: ignore[misc]
            text,
            flags=re.S,
        )
    tables = {
        "R squared of held-out pairs, FTW": model_table(data, both, targets),
        "R squared where both cases are new, by arm": arm_table(data, gains, by_arm),
        "Cost": cost_table(data, rules),
    }
    more = "".join(f"\n## {title}\n\n{markdown(rows)}" for title, rows in tables.items())
    for path, words in {PAGE: text, TABLES: f"# Tables of [the law of transfer](README.md)\n{more}"}.items():
        with atomic_write(path) as draft:
            draft.write_text(words)
    FOLDER.mkdir(parents=True, exist_ok=True)
    write_csv(FOLDER / "pairs.csv", pair_rows(data, gains[at], both[LAW_RULE]))
    write_csv(FOLDER / "regrets.csv", regret_rows(data, regrets))
    draw(FOLDER / "law.png", gains[at], both[LAW_RULE], regrets)
    names = (PAGE, TABLES, FILE, *(FOLDER / name for name in ("pairs.csv", "regrets.csv", "law.png")))
    sys.stdout.write("".join(f"{path}\n" for path in names))


def markdown(rows: Rows) -> str:
    """Return a table with its headings in the first row."""
    head, *rest = ([str(cell) for cell in row] for row in rows)
    return "".join(f"| {' | '.join(row)} |\n" for row in (head, ["---"] * len(head), *rest))


def model_table(data: Data, both: Mapping[str, Floats], targets: Mapping[str, Floats]) -> Rows:
    """Return what each model explains of the gains of `ARM`, in both splits."""
    gains = data.gains[ARM]
    tops = [ceiling(data, ARM, within=within) for within in (False, True)]
    every = np.ones(gains.shape[1:])
    model = Model(data.columns(), MODELS[NULL], gains.mean(0)[None])
    seen = LinearRegression().fit(model.indicators, model.gains).score(model.indicators, model.gains)
    head = ("both cases new: all pairs", "of the ceiling", "within targets", "of the ceiling")
    rows: Rows = [("model", *head, "new target: all pairs", "within targets")]
    rows.append(("the ceiling: agreement of seeds", f"{tops[0]:.2f}", "", f"{tops[1]:.2f}", "", "", ""))
    rows.append(("source + target, in the pairs that they are fitted on", f"{seen:.2f}", *[""] * 5))
    for name in MODELS:
        cells = []
        for top, within in zip(tops, (False, True), strict=True):
            found = explained_draws(gains, both[name], within=within)
            cells += [interval(found[0], found[1:]).words(), f"{found[0] / top:.0%}"]
        for within in (False, True):
            cells.append(f"{explained(gains.mean(0), targets[name], every, within=within):.2f}")
        shown = f"**{name}**" if name == LAW_RULE else name.replace("_", " ")
        rows.append((shown, *cells))
    return rows


def arm_table(data: Data, gains: Floats, both: Mapping[str, Floats]) -> Rows:
    """Return for each arm the ceilings, and what the null and the law explain of pairs that are both new."""
    rows: Rows = [("arm", "ceiling, all pairs", "within targets", NULL, LAW_RULE, "law within targets")]
    every = np.ones(gains.shape[1:])
    for at, arm in enumerate(data.gains):
        tops = [f"{ceiling(data, arm, within=within):.2f}" for within in (False, True)]
        found = [explained(gains[at], both[name][at], every, within=False) for name in (NULL, LAW_RULE)]
        found.append(explained(gains[at], both[LAW_RULE][at], every, within=True))
        rows.append((arm, *tops, *(f"{each:.2f}" for each in found)))
    return rows


def mean_regret(regrets: Floats) -> Estimate:
    """Return the mean of regrets [seeds, targets], with an interval over both."""
    seed, target = draws(*regrets.shape)
    drawn = np.einsum("ds,st,dt->d", seed, regrets, target) / regrets.size
    return interval(float(regrets.mean()), drawn)


def regret_table(regrets: Regrets) -> Rows:
    """Return the regret of each rule: over k where each source is tried, and where the rule picks one."""
    rows: Rows = [("rule", *(f"k = {size}" for size in range(1, MOST + 1)), "one of all 28")]
    rules = dict.fromkeys(rule for rule, *_ in regrets)
    last = max(size for _, size, _ in regrets)
    for rule in sorted(rules, key=lambda rule: mean_regret_at(regrets, rule)):
        cells = []
        for size in range(1, MOST + 1):
            one = mean_regret(regrets[rule, size, True]) if (rule, size, True) in regrets else None
            words = one.words("", 3) if one and size == SHOWN_SIZE else f"{one.value:.3f}" if one else ""
            cells.append(words)
        picks = (rule, last, False) in regrets and rule not in ONLY_SETS
        cells.append(mean_regret(regrets[rule, last, False]).words("", 3) if picks else "")
        rows.append((f"**{rule}**" if rule == LAW_RULE else rule, *cells))
    return rows


def mean_regret_at(regrets: Regrets, rule: str, size: int = SHOWN_SIZE) -> float:
    """Return the mean regret of a rule whose sources are each tried; infinite if it chooses no set."""
    found = regrets.get((rule, size, True))
    return np.inf if found is None else float(found.mean())


def test_table(data: Data, both: Mapping[str, Floats], regrets: Regrets) -> Rows:
    """Return what the plan's tests say."""
    gains = data.gains[ARM]
    law, null = (explained_draws(gains, both[name], within=False) for name in (LAW_RULE, NULL))
    more = interval(law[0] - null[0], (law - null)[1:])
    own = regrets[LAW_RULE, SHOWN_SIZE, True]
    above = mean_regret(own - regrets[HINDSIGHT, SHOWN_SIZE, True])
    best = min(PUBLISHED, key=lambda rule: mean_regret_at(regrets, rule))
    other = regrets[best, SHOWN_SIZE, True]
    left = mean_regret(own - SHARE * other)
    every = max(size for _, size, _ in regrets)
    pairs = [
        *((best, rule, SHOWN_SIZE, True) for rule in (HINDSIGHT, RANDOM, "SD-MBTL, L1")),
        *((ON_COMMAND, rule, every, False) for rule in ("zero-shot", "equation 8")),
    ]
    return [
        ("question", "figure", "answer"),
        ("1. R squared, the law less additive, above 0?", more.words("+"), "yes" if more.low > 0 else "no"),
        (f"2. regret of the law less hindsight's, k = 3, at most {BOUND}?", above.words("+", 3),
         "yes" if above.value <= BOUND else "no"),
        (f"3. regret of the law, k = 3, at most {SHARE:g} of {best}'s, the best published rule?",
         f"{own.mean():.3f} and {other.mean():.3f}; less {SHARE:g} of it {left.words('+', 3)}",
         "yes" if left.value <= 0 else "no"),
        *((f"not a test: regret of {one} less that of {other}, {'k = 3' if tried else f'one of all {size}'}",
           mean_regret(regrets[one, size, tried] - regrets[other, size, tried]).words("+", 3), "")
          for one, other, size, tried in pairs),
    ]  # fmt: skip


def cost_table(data: Data, rules: Sequence[Mapping[str, Rule]]) -> Rows:
    """Return core-seconds of measures and choices, what a choice saves, and target runs until it pays."""
    runs, count = data.runs, data.count
    short, long = sorted(runs["length"].unique())
    source = float(runs[runs["length"] == long]["seconds"].mean())
    target = float(runs[(runs["arm"] == ARM) & (runs["length"] == short)]["seconds"].mean())
    times, scratch = measure_times(data, short)
    rows: Rows = [
        ("what", "core-seconds", f"share of a run until {THRESHOLD}", "saved in a run", "pays after runs")
    ]
    rows.append((f"a source: {long:,} steps", f"{source:.2f}", "", "", ""))
    rows.append((f"a target run: {short:,} steps, scratch", f"{target:.2f}", f"{scratch:.2f}", "", ""))
    for name in ("similarity", *OF_SOURCE):
        cost = (count - 1) * data.seconds[name]
        rows.append((f"{name.replace('_', '-')} of {count - 1} sources", f"{cost:.3f}", "", "", ""))
    every, of_pair = count - 1, sum(data.seconds[name] for name in OF_SOURCE)
    costs = {
        ("equation 8", every): source,
        ("SD-MBTL", SHOWN_SIZE): SHOWN_SIZE * (source + every * data.seconds[ZERO_SHOT]),
        ("zero-shot", every): every * (source + data.seconds[ZERO_SHOT]),
        (ON_COMMAND, every): every * (source + data.seconds[ZERO_SHOT]),
        (LAW_RULE, every): every * (source + of_pair),
    }
    for (name, size), cost in costs.items():
        chosen = (each[name] for each in rules)
        picks = [pick(one.values, time, one.sets(size)) for one, time in zip(chosen, times, strict=True)]
        share = float(np.mean(picks))
        saved = (scratch - share) * target
        words = "one, the only one trained" if cost == source else f"one of {size}"
        runs_until = f"{np.ceil(cost / saved):.0f}"
        rows.append((f"{name}: {words}", f"{cost:.1f}", f"{share:.2f}", f"{saved:.2f}", runs_until))
    return rows


def measure_times(data: Data, length: int) -> tuple[Floats, float]:
    """Return shares of a run until a score of `THRESHOLD`: [seeds, targets, sources], and scratch's mean."""
    runs = data.runs[(data.runs["length"] == length) & data.runs["arm"].isin((ARM, SCRATCH.name))]
    returns = np.array([[float(word) for word in words.split()[1:]] for words in runs["greedy"]])
    low, high = (runs[name].to_numpy(float)[:, None] for name in ("random", "best_known"))
    passed = (returns - low) / (high - low) >= THRESHOLD
    runs = runs.assign(share=np.where(passed.any(1), (passed.argmax(1) + 1) / passed.shape[1], 1.0))
    is_scratch = runs["source"] == ""
    transfers = runs[~is_scratch].set_index(["seed", "target", "source"])["share"]
    places = pd.MultiIndex.from_product([sorted(transfers.index.unique("seed")), data.cases, data.cases])
    times = transfers.reindex(places).to_numpy().reshape(-1, data.count, data.count)
    return times, float(runs.loc[is_scratch, "share"].mean())


def from_pixels(model: Model, pixels: Data, numbers: Data, at: int) -> Sequence[str]:
    """Return how well the command's law, fitted on numbers without both cases, predicts gains from pixels."""
    names, every, columns = list(pixels.cases), list(numbers.cases), pixels.columns()
    found = np.full((len(names), len(names)), np.nan)
    blank = np.zeros((1, model.indicators.shape[1]))
    for target, source in permutations(range(len(names)), 2):
        held = [every.index(names[target]), every.index(names[source])]
        values = np.array([[columns[name][target, source] for name in model.names]])
        found[target, source] = model.fit_without(held).predict(values, blank)[0, at]
    measured = pixels.gains[ARM].mean(0)
    known = np.isfinite(found)
    squared = float(np.corrcoef(found[known], measured[known])[0, 1] ** 2)
    rank = float(by_target(found, measured).mean())
    words = f"{squared:.2f}; rank correlation within targets {rank:+.2f}"
    return "not a test: R squared of gains from pixels, after a shift and a scale", words, ""


def pick_errors(data: Data, model: Model, at: int) -> Floats:
    """Return measured less expected gains, [seeds, targets], of the source that a law picks for a new target.

    As on the command line, the score is that of the one network that is transferred.
    """
    gains, targets = data.gains[ARM], np.arange(data.count)
    found = []
    for seed, measured in enumerate(gains):
        predicted = model.new_cases(data.columns([seed]))[at]
        picks = np.nanargmax(predicted, 1)
        found.append(measured[targets, picks] - predicted[targets, picks])
    return np.array(found)


def reach(errors: Floats) -> float:
    """Return the half width of an interval that holds `LEVEL` of the runs of a new target (conformal)."""
    seeds, targets = errors.shape
    return float(np.sort(np.abs(errors), axis=None)[ceil(LEVEL * (targets + 1) * seeds) - 1])


def calibration(errors: Floats) -> Sequence[str]:
    """Return the mean error of the command, and how many lie in intervals made from the other targets."""
    others = [reach(np.delete(errors, target, axis=1)) for target in range(errors.shape[1])]
    words = f"{mean_regret(errors).words('+', 3)}; {(np.abs(errors) <= others).sum()} of {errors.size} runs"
    return f"not a test: gain less what the command expects; in its interval of {LEVEL:.0%}", words, ""


def write_laws(models: Mapping[str, Model], errors: Mapping[str, Floats], data: Data, at: int) -> None:
    """Write the coefficients of the command's laws, fitted on all pairs, and how far intervals reach."""
    found = []
    prints = [case.fingerprint for case in data.cases.values()]
    for name, missed in errors.items():
        mean, scale, ridge = models[name].fit()
        # One arm alone has no axis of its own.
        weights, count = [*map(digits, np.atleast_2d(ridge.coef_)[at])], len(mean)
        scaled = zip(map(digits, mean), map(digits, scale), weights, strict=False)
        found.append({
            "constant": digits(np.atleast_1d(ridge.intercept_)[at]),
            "columns": dict(zip(models[name].names, scaled, strict=True)),
            "sources": dict(zip(prints, weights[count:], strict=False)),
            "targets": dict(zip(prints, weights[count + len(prints) :], strict=True)),
            "reach": digits(reach(missed)),
        })  # fmt: skip
    with atomic_write(FILE) as draft:
        draft.write_text(json.dumps(found, indent=1) + "\n")


def digits(value: float) -> float:
    """Round to five digits, which other processors share."""
    return float(f"{value:.5g}")


def pair_rows(data: Data, gains: Floats, predicted: Floats) -> list[dict[str, Any]]:
    """Return a row for each pair: the gain that was measured, and the law's prediction without both cases."""
    names = list(data.cases)
    return [
        {"target": names[target], "source": names[source], "measured": f"{gains[target, source]:.4f}",
         "predicted": f"{predicted[target, source]:.4f}"}
        for target, source in zip(*np.nonzero(np.isfinite(gains)), strict=True)
    ]  # fmt: skip


def regret_rows(data: Data, regrets: Regrets) -> list[dict[str, Any]]:
    """Return a row for each rule, number of sources and way, with the mean regret of each target."""
    return [
        {"rule": rule, "k": size, "each is tried": int(tried)}
        | {name: f"{value:.4f}" for name, value in zip(data.cases, found.mean(0), strict=True)}
        for (rule, size, tried), found in regrets.items()
    ]


def draw(path: Path, gains: Floats, predicted: Floats, regrets: Regrets) -> None:
    """Draw predicted against measured gains, a point for each pair, and regret over the number of sources."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from ship_trl.view.style import CHART, CHART_SERIES, GREY, save_figure

    with mpl.rc_context(CHART):
        figure = Figure(figsize=(10, 4.6), dpi=100, layout="constrained")
        left, right = figure.subplots(1, 2)
        known = np.isfinite(gains)
        ends = float(np.nanmin(gains)), float(np.nanmax(gains))
        left.plot(ends, ends, color=GREY, linewidth=1)
        left.scatter(predicted[known], gains[known], s=9, alpha=0.5, color=CHART_SERIES[0], linewidths=0)
        left.set_xlabel("predicted gain, neither case seen", fontsize=12)
        left.set_ylabel("measured gain", fontsize=12)
        left.set_title(f"{known.sum()} pairs: the law", loc="left", fontsize=12)
        sizes = range(1, MOST + 1)
        shown = (RANDOM, "zero-shot", "SD-MBTL, L1", LAW_RULE, "SD-MBTL", HINDSIGHT)
        for rule, colour in zip(shown, (GREY, *CHART_SERIES), strict=False):
            line = [regrets[rule, size, True].mean() for size in sizes]
            right.plot(sizes, line, "o-" if rule == LAW_RULE else ".--", color=colour, label=rule)
        right.set_xticks(sizes)
        right.set_ylim(0, None)
        right.set_xlabel("sources trained", fontsize=12)
        right.set_ylabel("regret of held-out targets", fontsize=12)
        right.set_title("Regret, each source tried", loc="left", fontsize=12)
        right.legend(fontsize=11)
        save_figure(figure, path)
