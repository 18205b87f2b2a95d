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
def test_one_command_gives_the_kept_contrasts_and_what_the_page_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    for setting in SETTINGS:
        shutil.copy(KEPT / f"{setting}.csv.xz", tmp_path)
    main(["report", "--markdown"])
    for name in (f"{setting}_answers.csv" for setting in SETTINGS):
        assert (tmp_path / name).read_bytes() == (KEPT / name).read_bytes()
    rows = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines()]
    beside = {question: [row for row in rows if len(row) == 11 and row[0] == question] for question in "12"}
    alike = {question: sum(row[-2] == "yes" for row in found) for question, found in beside.items()}
    told = f"{alike['1']} of the {len(beside['1'])} contrasts of question 1, and all of question 2"
    assert told in PAGE.read_text()
    assert alike["2"] == len(beside["2"]) > 0
    decided = [row for row in beside["1"] if {row[5], row[8]} <= {"more", "less"}]
    assert f"Of the {len(decided)} that are more or less from both" in PAGE.read_text()
    assert all(row[5] == row[8] for row in decided)
    gains = [abs(float(row[-1])) for row in beside["1"] if row[2].endswith("less scratch")]
    far = sum(gain > 2.9 for gain in gains)
    assert f"{far} of the {len(gains)} gains over scratch are further" in PAGE.read_text()


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
