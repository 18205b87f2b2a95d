"""A question is measured as a claim's contrast of the same words is; what a study has not is refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.study.compare import ask
from ship_trl.study.metrics import METRICS
from ship_trl.study.statistics import Estimate
from ship_trl.study.study import Study, places_of, read_study
from studies.paper.claims import ALL, OURS
from studies.paper.contrasts import network_effect
from studies.paper.judge import measure
from tests.study.synthetic import write_planned


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    folder: Path = tmp_path_factory.mktemp("asked")
    write_planned(folder, 2, 60)
    return read_study(folder)


def measured(study: Study, question: str) -> list[Estimate]:
    return [found for one in ask(study, question) if (found := one.measure(study)) is not None]


def test_every_plain_contrast_of_a_claim_can_be_asked_for(study: Study) -> None:
    """Those of two sides, by the words that the report has for them."""
    asked = 0
    for claim in (*ALL, *OURS):
        for wanted in (one.found for one in measure(study, claim)):
            plain = re.fullmatch(r"(high|low|lowest|\d to \d): .+ (above|sooner than) .+", wanted.what)
            if plain and "epsilon" not in wanted.what:
                (found,) = measured(study, wanted.what)
                assert found.what == wanted.what
                assert found.differences == pytest.approx(wanted.differences)
                asked += 1
    assert asked > 100


def test_names_with_a_comma_are_one_name(study: Study) -> None:
    (found,) = measured(
        study, "new: mean of reused, low, reused, 1 above mean of scratch, low, scratch, 1 (area)"
    )
    wanted = network_effect("area").measure(study)
    assert wanted is not None and found.differences == pytest.approx(wanted.differences)


def test_every_pair_and_every_arm_are_many(study: Study) -> None:
    found = measured(study, "every pair: FTW above scratch (early area)")
    assert [one.what.partition(":")[0] for one in found] == ["high", "low", "lowest"]
    arms = [name for name in places_of(study)["low"] if name != "scratch"]
    assert {"FE4", "FTW", "FE3-permuted"} < set(arms)
    assert [one.what for one in measured(study, "low: every arm above scratch")] == [
        f"low: {arm} above scratch (area)" for arm in arms
    ]


def test_an_arm_of_elsewhere_has_the_same_target(study: Study) -> None:
    (found,) = measured(study, "high: FE4 above FE4 of 2 to 2")
    runs = study.matched({"here": ("pairs", "high", "FE4"), "there": ("controls", "self", "FE4")})
    here, there = (np.array([METRICS["area"](run) for run in runs[name]]) for name in ("here", "there"))
    assert found.differences == pytest.approx(here - there)
    with pytest.raises(ConfigError, match="'FE4 of low' has target 4; allowed: target 2, as high"):
        ask(study, "high: FE4 above FE4 of low")


@pytest.mark.parametrize("metric", ["start", "time"])
def test_of_one_arm_it_is_the_level(study: Study, metric: str) -> None:
    (found,) = measured(study, f"2 to 2: FE1 ({metric})")
    runs = study.arm("controls", "self", "FE1").values()
    assert found.what == f"2 to 2: FE1 ({metric})"
    assert found.differences == pytest.approx([METRICS[metric](run) for run in runs])


@pytest.mark.parametrize(
    ("question", "told"),
    [
        ("FE3 above FE4", "got 'FE3 above FE4'"),
        ("high: FE3 below FE4", "no arm 'FE3 below FE4' in high; allowed: "),
        ("middle: FE3 above FE4", "no runs of 'middle'; allowed: every pair, high, low, lowest"),
        ("high: FE5 above FE4", "no arm 'FE5' in high; allowed: FE1 |"),
        ("high: FE3 above FE4 of 9 to 9", "no arm 'FE4 of 9 to 9'"),
        ("high: FE3 above FE4 (speed)", f"no metric 'speed'; allowed: {', '.join(METRICS)}"),
        ("high: FE3 above FE4 (time)", "time takes 'sooner than', got 'above'"),
        ("high: FE3 above FE3", "'FE3' stands on both sides"),
        ("high: mean of FE1, FE2 above mean of FE2, FE1", "'mean of FE1, FE2' stands on both sides"),
        ("high: mean of FE1 and FE2 above scratch", "no arm 'FE1 and FE2' in high"),
        ("high: mean of FE3 of nowhere, FE1 above scratch", "no arm 'FE3 of nowhere' in high"),
        ("high: mean of FE3 of low above scratch", "'FE3 of low' has target 4; allowed: target 2, as high"),
        ("high: FE3 above every arm", "no arm 'every arm' in high"),
        ("high: mean of , above FE3", "'mean of' names no arm"),
        ("high: FE3 sooner than FE4", "area takes 'above', got 'sooner than'"),
    ],
)
def test_what_a_study_has_not_is_refused(study: Study, question: str, told: str) -> None:
    with pytest.raises(ConfigError) as refused:
        ask(study, question)
    assert str(refused.value).startswith(f"question: {told}") and "\n" not in str(refused.value)
