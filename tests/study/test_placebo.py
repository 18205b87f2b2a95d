"""With labels that mean nothing the rules find nothing, or as seldom as they say."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from ship_trl.study.contrasts import Claimed, Finding, Verdict
from ship_trl.study.placebo import is_false, placebo, shuffled
from ship_trl.study.statistics import Estimate
from tests.study.synthetic import make_study
from tests.study.test_hypotheses import ends


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


@pytest.mark.parametrize(
    ("verdict", "claimed", "between", "false"),
    [
        (Verdict.supported, Claimed.above, True, True),
        (Verdict.contradicted, Claimed.above, True, True),
        (Verdict.supported, Claimed.alike, True, False),
        (Verdict.contradicted, Claimed.no_more, True, True),
        (Verdict.equivalent, Claimed.above, True, False),
        (Verdict.inconclusive, Claimed.above, True, False),
        # An arm against zero is what it is, whatever its label.
        (Verdict.supported, Claimed.above, False, False),
    ],
)
def test_what_is_a_false_verdict(verdict: Verdict, claimed: Claimed, between: bool, false: bool) -> None:
    estimate = Estimate(0.1, 0.05, 0.2)
    finding = Finding("H", "", estimate, None, 0.01, 0.01, 5, verdict, claimed=claimed, between=between)
    assert is_false(finding) is false


def test_large_effects_under_shuffled_labels_are_seldom_seen() -> None:
    found = placebo(make_study(ends(), seeds=5), shuffles=10)
    assert found.of_figures == 50 and found.of_contrasts > 1000
    # One figure in twenty is stated: seven of fifty would be more than chance.
    assert found.figures < 7 and found.contrasts < found.of_contrasts / 100
