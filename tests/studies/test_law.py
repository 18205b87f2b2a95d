"""The law of transfer: no held-out gain is seen, rules choose as they say, the page follows from tables."""

import csv
import lzma
import re
from collections import defaultdict
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from ship_trl.transfer import law
from studies.law import data, report
from studies.law.choose import (
    HINDSIGHT,
    MOST,
    RANDOM,
    Rule,
    all_regrets,
    best_sets,
    greedy,
    is_quality_constant,
)
from studies.law.model import MODELS, Model, explained
from tests.command import ROOT

KEPT, TABLES = ROOT / "outputs/law", ROOT / "outputs/sources"
PAGE = (ROOT / "studies/law/README.md").read_text()
COUNT = 8


def drawn(*shape: int, seed: int = 0) -> np.ndarray:
    found = np.random.default_rng(seed).normal(size=(*shape, COUNT, COUNT))
    found[..., np.eye(COUNT, dtype=bool)] = np.nan
    return found


@pytest.mark.parametrize("way", ["new_targets", "new_cases", "new_cases_and"])
def test_predictions_do_not_see_what_is_held_out(way: str) -> None:
    columns, gains = {"one": drawn(), "two": drawn(seed=1)}, drawn(1, seed=2)
    changed = gains.copy()
    changed[:, 3] += 5.0
    changed[:, :, 3] -= 5.0
    before, after = (getattr(Model(columns, ["one", "two"], each), way)() for each in (gains, changed))
    if way == "new_cases_and":
        np.testing.assert_array_equal(before[3], after[3])
        assert np.isfinite(before[3]).sum() == (COUNT - 1) ** 2
        assert before[1, 2, 4] != after[1, 2, 4]
    else:
        np.testing.assert_array_equal(before[0, 3], after[0, 3])
        assert np.array_equal(before[0, :3, 3], after[0, :3, 3]) == (way == "new_cases")
        assert before[0, 1, 2] != after[0, 1, 2]


def test_a_law_that_holds_is_found() -> None:
    columns = {"close": drawn()}
    gains = 0.3 + 0.5 * columns["close"]
    found = Model(columns, ["close"], gains[None]).new_cases()[0]
    every = np.ones(gains.shape)
    assert explained(gains, found, every, within=False) > 0.9
    assert explained(gains, np.full_like(gains, np.nanmean(gains)), every, within=False) == pytest.approx(0)
    # What all sources gain alike on a target is nothing within targets.
    lifted = found + np.arange(COUNT)[:, None]
    assert explained(gains, lifted, every, within=True) == pytest.approx(
        explained(gains, found, every, within=True)
    )


def test_sources_are_chosen_for_what_others_lack() -> None:
    values = np.zeros((4, 4))
    values[:, 0] = [0, 3, 3, 0]
    values[:, 1] = [2, 0, 3, 0]
    values[:, 2] = [1, 0, 0, 2]
    values[np.eye(4, dtype=bool)] = np.nan
    assert greedy(values, without=3)[:3] == [0, 2, 1]
    assert greedy(values, without=0)[0] == 1
    # One by one 0 is first; of two 0 and 2 leave least.
    assert best_sets(values, 2)[3] == (0, 2)
    assert is_quality_constant(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), [0, 1])
    assert not is_quality_constant(np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]), [0, 1])


def test_regrets_of_random_and_best_sets() -> None:
    gains = drawn(3)
    orders = [[case for case in range(COUNT) if case != held][:MOST] for held in range(COUNT)]
    found = all_regrets(gains, {"first": Rule(orders, gains.mean(0))})
    for seed, judged in enumerate(gains):
        known = np.delete(gains, seed, axis=0).mean(0)
        for target in (0, 5):
            others = [case for case in range(COUNT) if case != target]
            best = judged[target, max(others, key=lambda case: known[target, case])]
            tried = [
                judged[target, max(members, key=lambda case: known[target, case])]
                for members in combinations(others, 3)
            ]
            assert found[RANDOM, 3, True][seed, target] == pytest.approx(best - np.mean(tried))
            own = judged[target, max(orders[target][:2], key=lambda case: known[target, case])]
            assert found["first", 2, True][seed, target] == pytest.approx(best - own)
    assert set(found) >= {(HINDSIGHT, size, True) for size in range(1, MOST + 1)}


def test_the_coefficients_follow_from_the_kept_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(data, "FOLDER", TABLES)
    monkeypatch.setattr(report, "FILE", tmp_path / "law.json")
    table = data.read("numbers")
    gains = table.gains[law.ARM].mean(0)
    models = {
        name: Model(table.columns, MODELS[name], gains[None])
        for name in (report.CASES_ONLY, report.ON_COMMAND)
    }
    both = {name: model.new_cases()[0] for name, model in models.items()}
    report.write_laws(models, both, table, gains, 0)
    assert report.FILE.read_bytes() == law.FILE.read_bytes()


@pytest.mark.long
def test_the_page_follows_from_the_kept_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(data, "FOLDER", TABLES)
    for name in ("FOLDER", "PAGE", "FILE"):
        monkeypatch.setattr(report, name, tmp_path / name.lower())
    text = re.sub(r"(<!-- begin: \w+ -->\n).*?(<!-- end -->)", r"\1\2", PAGE, flags=re.S)
    (tmp_path / "page").write_text(text)
    report.report()
    assert (tmp_path / "page").read_text() == PAGE
    assert (tmp_path / "file").read_bytes() == law.FILE.read_bytes()
    for name in ("pairs.csv", "regrets.csv"):
        assert (tmp_path / "folder" / name).read_bytes() == (KEPT / name).read_bytes()
    assert (tmp_path / "folder/law.png").stat().st_size > 10_000


def read_runs() -> tuple[dict[tuple[str, str], list[float]], dict[str, float], float]:
    """Read FTW's scores by target and source in the order of seeds, scratch's means, and its mean time."""
    transfers, scratch, times = defaultdict(list), defaultdict(list), []
    with lzma.open(TABLES / "numbers.csv.xz", "rt", newline="") as file:
        for row in sorted(csv.DictReader(file), key=lambda row: int(row["seed"])):
            low, high = float(row["random"]), float(row["best_known"])
            scores = [(float(word) - low) / (high - low) for word in row["greedy"].split()[1:]]
            area = sum(max(0.0, score) for score in scores) / len(scores)
            if row["arm"] == "FTW":
                transfers[row["target"], row["source"]].append(area)
            elif row["arm"] == "scratch" and row["length"] == "12000":
                scratch[row["target"]].append(area)
                times.append(
                    next((k + 1 for k, one in enumerate(scores) if one >= 0.65), len(scores)) / len(scores)
                )
    return transfers, {case: sum(each) / len(each) for case, each in scratch.items()}, sum(times) / len(times)


def test_three_numbers_of_the_page_by_other_means() -> None:
    transfers, scratch, time = read_runs()
    # 1. R squared of the law where both cases are new: predictions kept, gains from the runs.
    gains = {pair: sum(areas) / 3 - scratch[pair[0]] for pair, areas in transfers.items()}
    with (KEPT / "pairs.csv").open(newline="") as file:
        predicted = {(row["target"], row["source"]): float(row["predicted"]) for row in csv.DictReader(file)}
    mean = sum(gains.values()) / len(gains)
    error = sum((gains[pair] - predicted[pair]) ** 2 for pair in gains)
    squared = 1 - error / sum((gain - mean) ** 2 for gain in gains.values())
    assert len(gains) == 812 and f"| **the law** | {squared:.2f} (" in PAGE
    assert f"it explains {100 * squared:.0f} % of the\nvariance of gains" in PAGE
    # 2. Regret of the source with the largest zero-shot score, of all 28.
    shots: dict[tuple[str, str], float] = defaultdict(float)
    with (TABLES / "numbers_measures.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            shots[row["target"], row["source"]] += float(row["zero_shot"])
    regrets = []
    for target in scratch:
        others = [source for source in scratch if source != target]
        top = max(shots[target, source] for source in others)
        first = [source for source in others if shots[target, source] > top - 1e-9]
        for judge in range(3):
            rest = [seed for seed in range(3) if seed != judge]
            best = max(others, key=lambda one: sum(transfers[target, one][seed] for seed in rest))
            picked = sum(transfers[target, one][judge] for one in first) / len(first)
            regrets.append(transfers[target, best][judge] - picked)
    line = next(line for line in PAGE.splitlines() if line.startswith("| zero-shot | "))
    assert line.split(" | ")[-1].startswith(f"{sum(regrets) / len(regrets):.3f} (")
    # 3. The share of a run from scratch until a score of 0.65.
    assert f"scratch | 0.94 | {time:.2f} |" in PAGE
