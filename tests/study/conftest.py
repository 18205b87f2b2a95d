"""A study that ran through, for all tests that compare with it, and margins of the tests' own."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from ship_trl.study.margins import Margins
from tests.command import KEYS
from tests.study.commands import SMALL, study


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        for name, key in KEYS.items():
            patch.setenv(name, key)
        done = study(*SMALL, folder=folder)
    assert "6 of 6 runs to do, about" in done.stdout
    return folder


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
