"""The tables that are kept of the second study give the page."""

import re
import shutil
from pathlib import Path

import pytest

from ship_trl.study.study import read_study
from studies.second import report
from studies.second.__main__ import main
from studies.second.plan import SETTINGS
from tests.command import ROOT
from tests.findings import NUMBER, NUMBERS, rewrite

KEPT = ROOT / "outputs/questions"
PAGE = ROOT / "studies/second/README.md"


@pytest.mark.long
def test_one_command_gives_the_pages_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    for setting in SETTINGS:
        shutil.copy(KEPT / f"{setting}.csv.xz", tmp_path)
    main(["report", "--markdown"])
    printed = capsys.readouterr().out
    for setting in SETTINGS:
        head, _, rest = printed.partition(f"{tmp_path}/{setting}_answers.csv\n{tmp_path}/{setting}.png\n")
        assert head.strip() == f"From {setting}\n\n{kept_block(setting)}"
        printed = rest.lstrip()
        name = f"{setting}_answers.csv"
        assert (tmp_path / name).read_bytes() == (KEPT / name).read_bytes()
    assert printed.strip() == kept_block("both")


@pytest.mark.parametrize("words", [["both"], []])
def test_power_is_simulated_for_one_observation(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["report", *words, "--power"])
    assert stopped.value.code == 1
    said = f"--power with {words[0] if words else 'no setting'}; allowed: with numbers or pixels"
    assert said in capsys.readouterr().err


def kept_block(name: str) -> str:
    """Return what the page has between its marks."""
    kept = re.search(rf"<!-- begin: {name} -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None
    return kept[1].strip()


@pytest.mark.parametrize(("setting", "block"), [("numbers", "power"), ("pixels", "power_pixels")])
def test_its_power_is_what_the_simulation_says(
    setting: str, block: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(report, "SOURCES", ROOT / "outputs/sources")
    main(["report", setting, "--power", "--markdown"])
    assert kept_block(block) == capsys.readouterr().out.strip()


@pytest.mark.parametrize("folder", ["ppo", "ppo_pixels", "n_step"])
def test_the_contrasts_of_another_learner_are_those_of_its_kept_study(folder: str) -> None:
    told = kept_block(folder)
    assert len(re.findall(NUMBERS, told)) == 4
    wrong = re.sub(rf"{NUMBER}(?!\d)", lambda m: "+9." + m[0].partition(".")[2], told)
    assert rewrite(wrong, read_study(KEPT / folder)) == told
