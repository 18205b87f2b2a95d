"""Margins of the tests' own."""

from collections.abc import Iterator

import pytest

from ship_trl.study.margins import Margins


@pytest.fixture(scope="package", autouse=True)
def gains() -> Iterator[dict[str, dict[str, float]]]:
    """What could be gained by case and metric: tests must not hang on what conf/analysis.yaml says of it.

    Of the package, so that what a module's fixtures compute goes by the same.
    """
    score = {"area": 0.12, "time": 0.15}
    known = {"2": score, "4": score, "6": score | {"dip": 0.4}}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ship_trl.study.margins.margins", lambda: Margins(0.2, known))
        yield known
