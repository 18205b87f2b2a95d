"""A study that ran through, for all tests that compare with it."""

from pathlib import Path

import pytest

from tests.study.commands import SMALL, study


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    done = study(*SMALL, folder=folder)
    assert "6 of 6 runs to do, about" in done.stdout
    return folder
