"""The command that shows the cases: Table 2, a picture, and which source a target should take."""

from pathlib import Path

import pytest
from PIL import Image

from ship_trl.cli.cases import main
from tests.command import ROOT, ship_trl


def test_cases_command_prints_table_2_and_a_picture(tmp_path: Path) -> None:
    done = ship_trl(folder=tmp_path, verb="cases")
    for pair, value in (("high", "0.83"), ("low", "0.45"), ("lowest", "0.42")):
        assert any(pair in row and value in row for row in done.stdout.splitlines())
    assert (tmp_path / "outputs/cases.png").stat().st_size > 20_000


def test_cases_command_recommends_a_source(tmp_path: Path) -> None:
    done = ship_trl("--target", "new", folder=tmp_path, verb="cases")
    line = "python -m ship_trl source=2 target=new method=feature_extraction layers=3"
    assert line in done.stdout.splitlines()
    with Image.open(tmp_path / "outputs/case_new.png") as picture:
        assert picture.height < 400  # of this case alone
    assert not (tmp_path / "outputs/cases.png").exists()
    done = ship_trl("--target", "banana", folder=tmp_path, verb="cases", code=1)
    assert done.stderr.startswith("ship_trl: --target: no case banana; allowed: 1, 2")
    assert done.stderr.count("\n") == 1


def test_the_picture_of_a_target_goes_where_it_is_asked_to(tmp_path: Path) -> None:
    main(["--target", "new", "--picture", "a.png"])
    assert [path.name for path in tmp_path.rglob("*.png")] == ["a.png"]


@pytest.mark.skipif(not (ROOT / ".gitignore").exists(), reason="no checkout")
def test_pictures_of_the_cases_change_no_file_of_the_checkout() -> None:
    kept = [line for line in (ROOT / ".gitignore").read_text().splitlines() if line.startswith("!/outputs/")]
    assert kept and not any("case" in line for line in kept)
