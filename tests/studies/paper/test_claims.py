"""Claims come out as the truth is, and stand on the contrasts that are listed."""

from pathlib import Path

import pytest

from ship_trl.study.claims import load_claims
from ship_trl.study.metrics import METRICS
from ship_trl.study.plan import OTHER_SOURCES, SOURCES, plan_jobs, to_study
from studies.paper.claims import ALL, HYPOTHESES, OURS
from studies.paper.judge import Verdict, judge_all, measure
from tests.study.synthetic import make_study, ranked

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
        **{(low, f"{case}-new", "FTW"): 0.6 for case in OTHER_SOURCES},
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
    return {
        sign: {a.claim.name: a.verdict for a in judge_all(ranked(ends(sign), seeds=10), ALL)}
        for sign in (1.0, -1.0)
    }


@pytest.mark.parametrize("name", LEVELS)
def test_a_true_claim_is_supported_and_a_false_one_contradicted(
    name: str, verdicts: dict[float, dict[str, Verdict]]
) -> None:
    assert verdicts[1.0][name] is Verdict.supported
    assert verdicts[-1.0][name] is Verdict.contradicted


def test_a_claim_whose_runs_are_there_in_part_stays_open() -> None:
    study = make_study({("pairs", "high", "FTW"): 0.9, ("pairs", "high", "scratch"): 0.5})
    answers = judge_all(study, ALL)
    assert [one.claim for one in answers] == ALL
    (found,) = (one for one in answers if one.claim.name == "H5f")
    assert [one.verdict for one in found.findings] == [Verdict.supported]
    assert found.missing == 8 and found.verdict is Verdict.inconclusive
    (nothing,) = (one for one in answers if one.claim.name == "H7d")
    assert nothing.word == "no runs" and nothing.verdict is Verdict.inconclusive


def test_only_seeds_that_both_arms_have_are_compared() -> None:
    study = make_study({("pairs", "high", arm): 0.5 for arm in ("FE1", "FT1")}, seeds=6)
    for seed in (2, 4):
        del study.records["pairs", "high", "FT1", seed]
    (found,) = (a.findings[0].found for a in judge_all(study, ALL) if a.claim.name == "H5e")
    assert found.seeds == 4


def test_names_are_unique_and_in_the_order_of_the_figures() -> None:
    names = [claim.name for claim in HYPOTHESES]
    assert len(set(names)) == len(names) and names == sorted(names)


def test_every_claim_stands_on_these_contrasts() -> None:
    """Read contrasts.txt beside studies/paper/claims.py: it says in words what is measured."""
    jobs = plan_jobs(to_study(["profile=smoke"]))
    places = {(j.part, j.label, j.arm): 0.99 for j in jobs if j.part != SOURCES}
    study, lines = make_study(places, seeds=2, episodes=300), []
    for claim in (*ALL, *OURS):
        found = measure(study, claim)
        words = [f"  {one.found.what}: {one.claimed.value}" for one in found]
        assert len(set(words)) == len(claim.tests), claim.name
        lines += [claim.name, *words]
    assert lines == (Path(__file__).parent / "contrasts.txt").read_text().splitlines()


def test_the_file_is_what_a_report_loads() -> None:
    loaded = load_claims()
    assert loaded.margin == 0.2 and loaded.possible_gain("2", "area") == 0.163
    assert all(set(gains) <= set(METRICS) for gains in loaded.gains.values())
    assert loaded.page is not None and loaded.page.is_file() and all(path.is_file() for path in loaded.rules)
    assert loaded.title("high", "pair high") == "Figure 5: pair high"
