"""What the page of the second study shows is what its commands print."""

import re

import pytest

from benchmarks import answers
from tests.command import ROOT

PAGE = ROOT / "docs/second-study.md"


def test_its_power_is_what_the_simulation_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(answers, "BENCHMARK", ROOT / "outputs/sources")
    answers.main(["numbers", "--power", "--markdown"])
    kept = re.search(r"<!-- begin: power -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None and kept[1].strip() == capsys.readouterr().out.strip()
