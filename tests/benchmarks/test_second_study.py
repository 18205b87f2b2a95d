"""The tables that are kept of the second study give the page."""

import re
import shutil
from pathlib import Path

import pytest

from benchmarks import answers
from tests.command import ROOT

KEPT = ROOT / "outputs/questions"
PAGE = ROOT / "docs/second-study.md"


def test_the_page_follows_from_the_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(answers, "FOLDER", tmp_path)
    shutil.copy(KEPT / "numbers.csv.xz", tmp_path)
    answers.main(["numbers", "--markdown"])
    printed = capsys.readouterr().out
    kept = re.search(r"<!-- begin: numbers -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None and kept[1].strip() == printed[: printed.index(str(tmp_path))].strip()
    assert (tmp_path / "numbers_answers.csv").read_bytes() == (KEPT / "numbers_answers.csv").read_bytes()


def test_its_power_is_what_the_simulation_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(answers, "BENCHMARK", ROOT / "outputs/sources")
    answers.main(["numbers", "--power", "--markdown"])
    kept = re.search(r"<!-- begin: power -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None and kept[1].strip() == capsys.readouterr().out.strip()
