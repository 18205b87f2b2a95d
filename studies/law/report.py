"""Tables, picture and coefficients of the law of transfer; plan.md has the rules, README.md is the page."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sklearn import config_context
from sklearn.linear_model import LinearRegression

from ship_trl.config.arm import SCRATCH
from ship_trl.files.disk import atomic_write
from ship_trl.study.report.tables import write_csv
from ship_trl.study.statistics import Estimate
from ship_trl.transfer.law import ARM, FILE, ZERO_SHOT
from studies.law.choose import HINDSIGHT, LAW_RULE, MOST, PUBLISHED, RANDOM, Rule, all_regrets, make_rules
from studies.law.data import COMMAND, LAW_OF_CASES, OF_SOURCE, Data, Floats, read
from studies.law.model import (
    MODELS,
    Model,
    ceiling,
    draws,
    explained,
    explained_draws,
    interval,
)
from studies.sources.judge import by_target

FOLDER, PAGE = Path("outputs/law"), Path(__file__).parent / "README.md"
THE_LAW, NULL, ON_COMMAND, CASES_ONLY = "the law", "additive", "law of the command", "law of cases"
SHOWN_SIZE, BOUND, SHARE, ERRORS = 3, 0.02, 0.75, (5, 95)
THRESHOLD = 0.65
Regrets = Mapping[tuple[str, int, bool], Floats]
Rows = list[Sequence[object]]


def report() -> None:
    """Write the page's blocks, its tables and picture, and the coefficients of the command."""
    with config_context(assume_finite=True, skip_parameter_validation=True):
        data = read("numbers")
        arms = list(data.gains)
        gains, at = np.stack([each.mean(0) for each in data.gains.values()]), arms.index(ARM)
        models = {name: Model(data.columns, columns, gains) for name, columns in MODELS.items()}
        both = {name: model.new_cases() for name, model in models.items()}
        targets = {name: model.new_targets() for name, model in models.items()}
        predicted = {LAW_RULE: both[THE_LAW][at], CASES_ONLY: both[CASES_ONLY][at]}
        rules = make_rules(data, predicted)
        # Only picks one of all: it chooses no sets.
        rules[ON_COMMAND] = Rule([[]] * data.count, both[ON_COMMAND][at])
        regrets = all_regrets(data.gains[ARM], rules)
        write_laws(models, {name: each[at] for name, each in both.items()}, data, gains[at], at)
        pixels = from_pixels(models[ON_COMMAND], read("pixels"), data, at)
    blocks = {
        "models": model_table(data, both, targets, at),
        "arms": arm_table(data, gains, both),
        "regrets": regret_table(regrets),
        "costs": cost_table(data, rules),
        "tests": [*test_table(data, both, regrets, at), calibration(data, both[ON_COMMAND][at]), pixels],
    }
    FOLDER.mkdir(parents=True, exist_ok=True)
    write_csv(FOLDER / "pairs.csv", pair_rows(data, gains[at], both[THE_LAW][at]))
    write_csv(FOLDER / "regrets.csv", regret_rows(data, regrets))
    draw(FOLDER / "law.png", gains[at], both[THE_LAW][at], regrets)
    text = PAGE.read_text()
    for name, rows in blocks.items():
        text = re.sub(
            rf"(<!-- begin: {name} -->\n).*?(<!-- end -->)",
            lambda mark, rows=rows: mark[1] + markdown(rows) + mark[2],  # type: ignore[misc]
            text,
            flags=re.S,
        )
    with atomic_write(PAGE) as draft:
        draft.write_text(text)
    names = (PAGE, FILE, *(FOLDER / name for name in ("pairs.csv", "regrets.csv", "law.png")))
    sys.stdout.write("".join(f"{path}\n" for path in names))


def markdown(rows: Rows) -> str:
    """Return a table with its headings in the first row."""
    head, *rest = ([str(cell) for cell in row] for row in rows)
    return "".join(f"| {' | '.join(row)} |\n" for row in (head, ["---"] * len(head), *rest))


def model_table(data: Data, both: Mapping[str, Floats], targets: Mapping[str, Floats], at: int) -> Rows:
    """Return what each model explains of the gains of `ARM`, in both splits."""
    gains = data.gains[ARM]
    tops = [ceiling(data, ARM, within=within) for within in (False, True)]
    every = np.ones(gains.shape[1:])
    model = Model(data.columns, MODELS[NULL], gains.mean(0)[None])
    seen = LinearRegression().fit(model.indicators, model.gains).score(model.indicators, model.gains)
    head = ("both cases new: all pairs", "of the ceiling", "within targets", "of the ceiling")
    rows: Rows = [("model", *head, "new target: all pairs", "within targets")]
    rows.append(("the ceiling: agreement of seeds", f"{tops[0]:.2f}", "", f"{tops[1]:.2f}", "", "", ""))
    rows.append(("source + target, in the pairs that they are fitted on", f"{seen:.2f}", *[""] * 5))
    for name in MODELS:
        cells = []
        for top, within in zip(tops, (False, True), strict=True):
            found = explained_draws(gains, both[name][at], within=within)
            cells += [interval(found[0], found[1:]).words(), f"{found[0] / top:.0%}"]
        for within in (False, True):
            cells.append(f"{explained(gains.mean(0), targets[name][at], every, within=within):.2f}")
        shown = f"**{name}**" if name == THE_LAW else name.replace("_", " ")
        rows.append((shown, *cells))
    return rows


def arm_table(data: Data, gains: Floats, both: Mapping[str, Floats]) -> Rows:
    """Return for each arm the ceilings, and what the null and the law explain of pairs that are both new."""
    rows: Rows = [("arm", "ceiling, all pairs", "within targets", NULL, THE_LAW, "the law within targets")]
    every = np.ones(gains.shape[1:])
    for at, arm in enumerate(data.gains):
        tops = [f"{ceiling(data, arm, within=within):.2f}" for within in (False, True)]
        found = [explained(gains[at], both[name][at], every, within=False) for name in (NULL, THE_LAW)]
        found.append(explained(gains[at], both[THE_LAW][at], every, within=True))
        rows.append((arm, *tops, *(f"{each:.2f}" for each in found)))
    return rows


def mean_regret(regrets: Floats) -> Estimate:
    """Return the mean of regrets [seeds, targets], with an interval over both."""
    seed, target = draws(*regrets.shape)
    drawn = np.einsum("ds,st,dt->d", seed, regrets, target) / regrets.size
    return interval(float(regrets.mean()), drawn)


def regret_table(regrets: Regrets) -> Rows:
    """Return the regret of each rule: over k where each source is tried, and where the rule picks one."""
    rows: Rows = [
        ("rule", *(f"k = {size}" for size in range(1, MOST + 1)), "k = 3, one is picked", "one of all 28")
    ]
    rules = dict.fromkeys(rule for rule, *_ in regrets)
    last = max(size for _, size, _ in regrets)
    for rule in sorted(rules, key=lambda rule: mean_regret_at(regrets, rule)):
        cells = []
        for size in range(1, MOST + 1):
            one = mean_regret(regrets[rule, size, True]) if (rule, size, True) in regrets else None
            words = one.words("", 3) if one and size == SHOWN_SIZE else f"{one.value:.3f}" if one else ""
            cells.append(words)
        for size in (SHOWN_SIZE, last):
            is_known = (rule, size, False) in regrets
            is_known &= size == SHOWN_SIZE or rule not in PUBLISHED[3:]
            cells.append(mean_regret(regrets[rule, size, False]).words("", 3) if is_known else "")
        rows.append((f"**{rule}**" if rule == LAW_RULE else rule, *cells))
    return rows


def mean_regret_at(regrets: Regrets, rule: str, size: int = SHOWN_SIZE) -> float:
    """Return the mean regret of a rule whose sources are each tried; infinite if it chooses no set."""
    found = regrets.get((rule, size, True))
    return np.inf if found is None else float(found.mean())


def test_table(data: Data, both: Mapping[str, Floats], regrets: Regrets, at: int) -> Rows:
    """Return what the plan's tests say."""
    gains = data.gains[ARM]
    law, null = (explained_draws(gains, both[name][at], within=False) for name in (THE_LAW, NULL))
    more = interval(law[0] - null[0], (law - null)[1:])
    own = regrets[LAW_RULE, SHOWN_SIZE, True]
    above = mean_regret(own - regrets[HINDSIGHT, SHOWN_SIZE, True])
    best = min(PUBLISHED, key=lambda rule: mean_regret_at(regrets, rule))
    other = regrets[best, SHOWN_SIZE, True]
    left = mean_regret(own - SHARE * other)
    every = max(size for _, size, _ in regrets)
    pairs = [
        *((best, rule, SHOWN_SIZE, True) for rule in (HINDSIGHT, RANDOM, "zero-shot", "equation 7")),
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


def cost_table(data: Data, rules: Mapping[str, Rule]) -> Rows:
    """Return core-seconds of measures and choices, what a choice saves, and target runs until it pays."""
    runs, count = data.runs, data.count
    short, long = sorted(runs["length"].unique())
    source = float(runs[runs["length"] == long]["seconds"].mean())
    target = float(runs[(runs["arm"] == ARM) & (runs["length"] == short)]["seconds"].mean())
    times = measure_times(data, short)
    scratch = float(np.diagonal(times).mean())
    rows: Rows = [
        ("what", "core-seconds", f"share of a run until {THRESHOLD}", "saved in a run", "pays after runs")
    ]
    rows.append((f"a source: {long:,} steps", f"{source:.2f}", "", "", ""))
    rows.append((f"a target run: {short:,} steps, scratch", f"{target:.2f}", f"{scratch:.2f}", "", ""))
    for name in ("similarity", *OF_SOURCE):
        cost = (count - 1) * data.seconds[name]
        rows.append((f"{name.replace('_', '-')} of {count - 1} sources", f"{cost:.3f}", "", "", ""))
    every, of_pair = count - 1, sum(data.seconds[name] for name in OF_SOURCE)
    chosen = {
        ("equation 8", 0): source,
        ("SD-MBTL", SHOWN_SIZE): SHOWN_SIZE * (source + every * data.seconds[ZERO_SHOT]),
        ("zero-shot", 0): every * (source + data.seconds[ZERO_SHOT]),
        (ON_COMMAND, 0): every * (source + data.seconds[ZERO_SHOT]),
        (LAW_RULE, 0): every * (source + of_pair),
    }
    for (name, size), cost in chosen.items():
        orders, values = rules[name]
        sets = [orders[at][:size] if size else np.flatnonzero(np.arange(count) != at) for at in range(count)]
        picks = [members[int(values[at, members].argmax())] for at, members in enumerate(map(np.array, sets))]
        share = float(np.mean(times[np.arange(count), picks]))
        saved = (scratch - share) * target
        words = (
            f"one of {size}" if size else "one, the only one trained" if cost == source else f"one of {every}"
        )
        runs_until = f"{np.ceil(cost / saved):.0f}"
        rows.append((f"{name}: {words}", f"{cost:.1f}", f"{share:.2f}", f"{saved:.2f}", runs_until))
    return rows


def measure_times(data: Data, length: int) -> Floats:
    """Return shares of a run until the first score of `THRESHOLD`, [targets, sources]; scratch at i, i."""
    runs = data.runs[(data.runs["length"] == length) & data.runs["arm"].isin((ARM, SCRATCH.name))]
    returns = np.array([[float(word) for word in words.split()[1:]] for words in runs["greedy"]])
    low, high = (runs[name].to_numpy(float)[:, None] for name in ("random", "best_known"))
    passed = (returns - low) / (high - low) >= THRESHOLD
    share = np.where(passed.any(1), (passed.argmax(1) + 1) / passed.shape[1], 1.0)
    place = {case: at for at, case in enumerate(data.cases)}
    target = runs["target"].map(place).to_numpy()
    source = np.where(runs["source"] == "", target, runs["source"].map(place))
    total, number = np.zeros((2, data.count, data.count))
    np.add.at(total, (target, source.astype(int)), share)
    np.add.at(number, (target, source.astype(int)), 1)
    return total / number


def from_pixels(model: Model, pixels: Data, numbers: Data, at: int) -> Sequence[str]:
    """Return how well the command's law, fitted on numbers without both cases, predicts gains from pixels."""
    names, every = list(pixels.cases), list(numbers.cases)
    found = np.full((len(names), len(names)), np.nan)
    for target, one in enumerate(names):
        for source, other in enumerate(names):
            if source != target:
                held = [every.index(one), every.index(other)]
                scaler, ridge = model.fit(~(np.isin(model.target, held) | np.isin(model.source, held)))
                values = np.array([[pixels.columns[name][target, source] for name in COMMAND]])
                blank = np.zeros((1, model.indicators.shape[1]))
                found[target, source] = ridge.predict(np.hstack([scaler.transform(values), blank]))[0, at]
    measured = pixels.gains[ARM].mean(0)
    known = np.isfinite(found)
    squared = float(np.corrcoef(found[known], measured[known])[0, 1] ** 2)
    rank = float(by_target(found, measured).mean())
    words = f"{squared:.2f}; rank correlation within targets {rank:+.2f}"
    return "not a test: R squared of gains from pixels, after a shift and a scale", words, ""


def calibration(data: Data, predicted: Floats) -> Sequence[str]:
    """Return by how much the measured gains of the command's picks of new targets miss what is expected."""
    gains, at = data.gains[ARM], np.arange(data.count)
    picks = np.nanargmax(predicted, 1)
    missed = gains[:, at, picks] - predicted[at, picks]
    low, high = np.nanpercentile(gains.mean(0) - predicted, ERRORS)
    within = int(((missed.mean(0) >= low) & (missed.mean(0) <= high)).sum())
    words = f"{mean_regret(missed).words('+', 3)}; {within} of {data.count} in the interval"
    return "not a test: measured less expected gain of the source that the command picks", words, ""


def write_laws(
    models: Mapping[str, Model], both: Mapping[str, Floats], data: Data, gains: Floats, at: int
) -> None:
    """Write the coefficients of the command, fitted on all pairs, and errors where both cases are new."""
    found = []
    for name, columns in {CASES_ONLY: LAW_OF_CASES, ON_COMMAND: COMMAND}.items():
        scaler, ridge = models[name].fit()
        # One arm alone has no axis of its own.
        weights, count = np.atleast_2d(ridge.coef_)[at], len(columns)
        prints = [case.fingerprint for case in data.cases.values()]
        low, high = np.nanpercentile(gains - both[name], ERRORS)
        scaled = zip(scaler.mean_, scaler.scale_, weights[:count], strict=True)
        found.append({
            "constant": digits(np.atleast_1d(ridge.intercept_)[at]),
            "columns": {key: [*map(digits, values)] for key, values in zip(columns, scaled, strict=True)},
            "sources": dict(zip(prints, map(digits, weights[count : count + len(prints)]), strict=True)),
            "targets": dict(zip(prints, map(digits, weights[count + len(prints) :]), strict=True)),
            "errors": [digits(low), digits(high)],
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
        if np.isfinite(found).all()
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
        left.set_title("812 pairs: the law", loc="left", fontsize=12)
        sizes = range(1, MOST + 1)
        shown = (RANDOM, "equation 8", "zero-shot", LAW_RULE, "SD-MBTL", HINDSIGHT)
        for rule, colour in zip(shown, (GREY, *CHART_SERIES), strict=False):
            line = [regrets[rule, size, True].mean() for size in sizes]
            right.plot(sizes, line, "o-" if rule == LAW_RULE else ".--", color=colour, label=rule)
        right.set_xticks(sizes)
        right.set_ylim(0, None)
        right.set_xlabel("sources trained", fontsize=12)
        right.set_ylabel("regret of a target that was held out", fontsize=12)
        right.set_title("Regret, each source tried", loc="left", fontsize=12)
        right.legend(fontsize=11)
        save_figure(figure, path)
