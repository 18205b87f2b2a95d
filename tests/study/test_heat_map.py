"""What the heat map compares with what."""

from dataclasses import replace

from ship_trl.study.heat_map import gain, rows
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
