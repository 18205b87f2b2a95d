"""The law of transfer: the coefficients that the study wrote, and what they say of a pair."""

import pytest

from ship_trl.sim.cases import load_case, load_world
from ship_trl.transfer.law import ARM, OF_CASE, OF_CASES, SOURCE, TARGET, ZERO_SHOT, describe, load_laws
from studies.law import data
from studies.law.model import Model
from tests.command import ROOT


def test_the_columns_are_those_of_the_study() -> None:
    of_cases, with_score = load_laws()
    columns = [prefix + name for prefix in (SOURCE, TARGET) for name in OF_CASE]
    assert list(of_cases.columns) == [*columns, *OF_CASES] == list(data.LAW_OF_CASES)
    assert list(with_score.columns) == [*of_cases.columns, ZERO_SHOT] == list(data.COMMAND)


@pytest.mark.parametrize("number", [0, 1])
def test_gains_are_expected_as_by_the_regression_that_was_fitted(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(data, "FOLDER", ROOT / "outputs/sources")
    table, world, law = data.read("numbers"), load_world(), load_laws()[number]
    columns = table.columns()
    model = Model(columns, (data.LAW_OF_CASES, data.COMMAND)[number], table.gains[ARM].mean(0)[None])
    fit = model.fit()
    names = list(table.cases)
    for source, target in (("3", "4"), ("1", "imazu07"), ("imazu20", "new")):
        at = names.index(target), names.index(source)
        row = model.row(*at)
        wanted = fit.predict(model.values[[row]], model.indicators[[row]])
        cases = load_case(source, world), load_case(target, world)
        values = describe(*cases, world) | {ZERO_SHOT: columns[ZERO_SHOT][at]}
        found = law.expect(*cases, values)
        assert found.gain == pytest.approx(wanted.item(), abs=2e-4)
        assert found.gain == pytest.approx(sum(found[3:]))
        assert found.low < found.gain < found.high


def test_a_source_that_scores_more_is_expected_to_gain_more() -> None:
    world, law = load_world(), load_laws()[1]
    source, target = load_case("3", world), load_case("4", world)
    values = describe(source, target, world)
    low, high = (law.expect(source, target, values | {ZERO_SHOT: score}) for score in (0.0, 1.0))
    more = high.gain - low.gain
    assert more > 0.05 and more == pytest.approx(high.closeness - low.closeness)
