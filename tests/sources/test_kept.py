"""The tables that are kept of the benchmark of sources give the page and what `cases` recommends."""

import re
import shutil
from pathlib import Path

import pytest

from benchmarks import similarity
from ship_trl.sources.judgements import BUNDLED_TABLE, read_judgements, winner
from tests.command import ROOT

KEPT = ROOT / "outputs/sources"
PAGE = ROOT / "docs/sources.md"


def test_the_page_and_the_bundled_table_follow_from_the_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(similarity, "FOLDER", tmp_path)
    for name in ("numbers.csv.xz", "numbers_measures.csv"):
        shutil.copy(KEPT / name, tmp_path / name)
    similarity.main(["numbers", "--markdown"])
    printed = capsys.readouterr().out
    tables = printed[: printed.index("the winner is")].strip()
    kept = re.search(r"<!-- begin: numbers -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None and kept[1].strip() == tables
    assert (tmp_path / "numbers_judgements.csv").read_bytes() == BUNDLED_TABLE.read_bytes()
    assert f"the winner is {winner(read_judgements()).measure}:" in printed
