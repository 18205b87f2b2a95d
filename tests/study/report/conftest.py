"""A study with its report, for all tests that read it."""

from pathlib import Path

import pytest

from ship_trl.cli.report import main
from tests.study.synthetic import write_study


@pytest.fixture(scope="package")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    write_study(folder, seeds=5)
    main([str(folder)])
    return folder
