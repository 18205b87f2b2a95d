"""The tables that are kept of the benchmark of sources give the page and what `cases` recommends."""

import re
import shutil
from pathlib import Path

import pytest

from benchmarks import similarity
from ship_trl.sources.judgements import BUNDLED_TABLE, read_judgements, winner
from ship_trl.sources.measures import MEASURES
from tests.command import ROOT

KEPT = ROOT / "outputs/sources"
PAGE = ROOT / "docs/sources.md"


@pytest.mark.parametrize(("setting", "after"), [("numbers", "the winner is"), ("pixels", "no arm is judged")])
def test_the_page_follows_from_the_runs(
    setting: str,
    after: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(similarity, "FOLDER", tmp_path)
    for name in (f"{setting}.csv.xz", f"{setting}_measures.csv"):
        shutil.copy(KEPT / name, tmp_path / name)
    similarity.main([setting, "--markdown"])
    printed = capsys.readouterr().out
    kept = re.search(rf"<!-- begin: {setting} -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None and kept[1].strip() == printed[: printed.index(after)].strip()
    assert (tmp_path / f"{setting}.png").stat().st_size > 10_000
    judged = tmp_path / f"{setting}_judgements.csv"
    assert judged.exists() == (setting == "numbers")
    if judged.exists():  # the table that `cases` recommends by
        assert judged.read_bytes() == BUNDLED_TABLE.read_bytes()
        best = winner(read_judgements()).measure
        assert f"the winner is {best}:" in printed
        assert best in MEASURES
