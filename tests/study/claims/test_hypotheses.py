"""Claims come out as the truth is: where the paper is right, where it is wrong, where runs lack."""

from pathlib import Path

import numpy as np
import pytest

from ship_trl.study.claims.hypotheses import HYPOTHESES
from ship_trl.study.claims.verdicts import ALL, answer
from ship_trl.study.compare import Verdict
from ship_trl.study.plan import FURTHER_SOURCES, OTHER_SOURCES
from ship_trl.study.study import read_study
from tests.study.synthetic import learning, make_study, ranked, write_run

ARMS = ("scratch", *(f"{kind}{n}" for kind in ("FE", "FT") for n in range(1, 5)), "FTW")
# Scores at the end as the paper's words have them.
HIGH = {"scratch": 0.6, "FE1": 0.75, "FE2": 0.5, "FE3": 0.9, "FE4": 0.8, "FT1": 0.4, "FT2": 0.65, "FT3": 0.7}
HIGH |= {"FT4": 0.78, "FTW": 0.98}
LOW = {
    "scratch": 0.5,
    "FE4": 0.3,
    **{f"FE{n}": 0.66 - 0.03 * n for n in (1, 2, 3)},
    **{f"FT{n}": 0.86 - 0.02 * n for n in range(1, 5)},
}
LOW |= {"FTW": 0.95}
LOWEST = {"scratch": 0.6, **{f"FE{n}": 0.8 - 0.1 * n for n in range(1, 5)}, "FE2": 0.68}
LOWEST |= {f"FT{n}": 0.98 - 0.08 * n for n in range(1, 5)} | {"FTW": 0.6}


def ends(sign: float = 1.0) -> dict[tuple[str, str, str], float]:
    """Truths by place; with sign -1 everything is the other way round."""
    found: dict[tuple[str, str, str], float] = {}
    for pair, scores in (("high", HIGH), ("low", LOW), ("lowest", LOWEST)):
        found |= {("pairs", pair, arm): 0.6 + sign * (score - 0.6) for arm, score in scores.items()}
    found |= {("controls", "ship", arm): 0.6 - sign * 0.3 for arm in ("FE3", "FTW")}
    found["controls", "high", "FE3-permuted"] = 0.6 - sign * 0.2
    self_transfer = {"FE1": 0.8, "FE2": 0.4, "FE3": 0.8, "FT1": 0.4, "FT2": 0.8}
    found["controls", "high", "FE3-random"] = 0.6 - sign * 0.2
    found |= {("controls", "self", arm): 0.6 + sign * (score - 0.6) for arm, score in self_transfer.items()}
    low, one = "reuse/epsilon_low", "reuse/epsilon_1"
    places: dict[tuple[str, str, str], float] = {
        (low, "2-new", "FTW"): 0.9,
        ("reuse/alone", "2-new", "FTW"): 0.9,
        (one, "2-new", "FTW"): 0.8,
        (low, "new", "scratch"): 0.5,
    }
    places |= {
        (one, "new", "scratch"): 0.4,
        **{(low, f"{case}-new", "FTW"): 0.6 for case in (*OTHER_SOURCES, *FURTHER_SOURCES)},
    }
    found |= {place: 0.65 + sign * (score - 0.65) for place, score in places.items()}
    return found


# Claims about spread, dips and early episodes are not made true by merit alone.
LEVELS = (
    *("C1", "C2", "C3", "H4a", "H5a", "H5c", "H5d", "H5e", "H5f", "H5g", "H5h", "H5j", "H5k", "H6a", "H6d"),
    *("H7a", "H7b", "H7c", "H7d", "H9a", "H9b"),
)


@pytest.fixture(scope="module")
def verdicts() -> dict[float, dict[str, Verdict]]:
    return {sign: {a.hypothesis.name: a.verdict for a in answer(ranked(ends(sign)))} for sign in (1.0, -1.0)}


@pytest.mark.parametrize("name", LEVELS)
def test_a_true_claim_is_supported_and_a_false_one_contradicted(
    name: str, verdicts: dict[float, dict[str, Verdict]]
) -> None:
    assert verdicts[1.0][name] is Verdict.supported
    assert verdicts[-1.0][name] is Verdict.contradicted


def test_a_claim_whose_runs_are_there_in_part_stays_open() -> None:
    study = make_study({("pairs", "high", "FTW"): 0.9, ("pairs", "high", "scratch"): 0.5})
    (found,) = (a for a in answer(study) if a.hypothesis.name == "H5f")
    assert [f.verdict for f in found.findings] == [Verdict.supported]
    assert found.missing == 8 and found.verdict is Verdict.inconclusive


def test_without_runs_there_is_no_verdict() -> None:
    answers = answer(make_study({("pairs", "high", "scratch"): 0.5}))
    assert len(answers) == len(ALL)
    assert all(a.verdict is Verdict.inconclusive and a.findings == [] for a in answers)


def test_only_seeds_that_both_arms_have_are_compared() -> None:
    study = make_study({("pairs", "high", arm): 0.5 for arm in ("FE1", "FT1")}, seeds=6)
    for seed in (2, 4):
        del study.records["pairs", "high", "FT1", seed]
    (found,) = (a.findings[0] for a in answer(study) if a.hypothesis.name == "H5e")
    assert found.seeds == 4


def test_a_study_is_read_from_its_folder_and_what_is_broken_is_named(tmp_path: Path) -> None:
    scores = learning(np.random.default_rng(0), 30)
    for seed in range(3):
        write_run(tmp_path / "pairs", scores, seed=seed)
    (tmp_path / "pairs/high/scratch/seed=1/curve.csv").unlink()
    (tmp_path / "pairs/high/scratch/seed=2").rename(tmp_path / "pairs/high/scratch/seed=9")
    study = read_study(tmp_path)
    assert list(study.records) == [("pairs", "high", "scratch", 0)]
    assert [(path.name, reason) for path, reason in study.broken] == [
        ("seed=1", "curve.csv is missing"),
        ("seed=9", "result.json is of another run"),
    ]


def test_names_are_unique_and_in_the_order_of_the_figures() -> None:
    names = [h.name for h in HYPOTHESES]
    assert len(set(names)) == len(names) and names == sorted(names)
    assert [a.hypothesis.name for a in answer(make_study({}))] == [h.name for h in ALL]
