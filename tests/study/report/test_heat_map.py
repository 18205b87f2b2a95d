"""What the heat map compares with what."""

from dataclasses import replace

from ship_trl.study.report.heat_map import ARMS, gain, rows
from tests.study.synthetic import make_study


def test_a_case_to_itself_may_be_a_pair_like_others() -> None:
    study = make_study({("pairs", "self", "scratch"): 0.5, ("pairs", "self", "FE1"): 0.7}, seeds=2)
    for key, record in study.records.items():
        study.records[key] = replace(record, source="2")
    ((name, (scratch, arms)),) = rows(study).items()
    assert name == "2 to 2" and gain(study, arms["FE1"], scratch) > 0.1


def test_as_a_control_it_is_compared_with_the_pair_that_has_its_target() -> None:
    ends = {("pairs", "high", "scratch"): 0.5, ("controls", "self", "FE1"): 0.7}
    found = rows(make_study(ends, seeds=2))
    scratch, arms = found["2 to 2"]
    assert scratch == ("pairs", "high", "scratch") and arms["FE1"] == ("controls", "self", "FE1")


def test_every_control_has_its_row_and_arm() -> None:
    places = {("controls", label, "FTW"): 0.8 for label in ("self", "self4", "self6", "ship")}
    places |= {("pairs", pair, "scratch"): 0.5 for pair in ("high", "low", "lowest")}
    places |= {("controls", "high", arm): 0.6 for arm in ("FE3-random", "FE3-permuted")}
    study = make_study(places, seeds=2)
    found = rows(study)
    for name in ("2 to 2", "4 to 4", "6 to 6", "ship to 2"):
        scratch, arms = found[name]
        assert gain(study, arms["FTW"], scratch) > 0.1
    assert {"FE3-random", "FE3-permuted"} <= set(ARMS)
