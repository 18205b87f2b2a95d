"""With labels that mean nothing the rules find nothing, or as seldom as they say."""

from collections import Counter
from dataclasses import replace

import numpy as np

from ship_trl.study.analysis.contrasts import Verdict
from ship_trl.study.claims.placebo import placebo, shuffled
from ship_trl.study.claims.verdicts import answer
from tests.study.claims.test_hypotheses import ends
from tests.study.synthetic import make_study


def test_runs_keep_their_case_and_seed_and_lose_their_arm() -> None:
    study = make_study({("pairs", "high", f"FE{n}"): 0.1 * n for n in range(1, 5)}, seeds=6)
    # Half of the seeds as if they were of another case.
    records = {k: replace(r, target="4" if k[3] < 3 else "2") for k, r in study.records.items()}
    study = replace(study, records=records)
    found = shuffled(study, np.random.default_rng(0))
    assert found.records.keys() == records.keys() and found.records != records
    for key, record in found.records.items():
        assert (record.seed, record.target) == (key[3], records[key].target)
    assert Counter(id(r) for r in found.records.values()) == Counter(id(r) for r in records.values())


def test_large_effects_under_shuffled_labels_are_seldom_seen() -> None:
    study = make_study(ends(), seeds=15)
    found = placebo(study, shuffles=8)
    assert found.of_figures >= 8 * 4 and found.of_claims > 100
    # One figure in twenty is stated: seven of some forty would be more than chance.
    assert found.figures < 7 and found.claims <= found.of_claims / 20
    # With the labels that they have the same runs decide.
    decided = [a for a in answer(study) if a.verdict is not Verdict.inconclusive]
    assert len(decided) > found.claims


def test_claims_of_no_difference_are_no_false_findings() -> None:
    # H6b stands on what shuffling makes true.
    study = make_study({("pairs", "low", arm): 0.7 for arm in ("FE1", "FE2", "FE3", "FT1", "FT2")}, sd=0.001)
    found = placebo(study, shuffles=3)
    assert found.claims == 0


def test_claims_of_spread_are_not_counted_where_none_could_be_decided() -> None:
    study = make_study({("pairs", "high", arm): 0.7 for arm in ("FE1", "scratch", "FE4", "FT2")})
    claims = [found.hypothesis.name for found in answer(study) if found.findings]
    # H5b is of spread alone.
    assert "H5b" in claims and placebo(study, shuffles=2).of_claims < 2 * len(claims)
