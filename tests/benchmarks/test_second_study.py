"""The tables that are kept of the second study give the page."""

import re
import shutil
from pathlib import Path

import pytest

from benchmarks import answers, power
from ship_trl.cli import ask
from ship_trl.study.analysis.study import read_study
from tests.command import ROOT
from tests.findings import NUMBER, NUMBERS, rewrite

KEPT = ROOT / "outputs/questions"
PAGE = ROOT / "docs/second-study.md"


def test_one_command_gives_the_pages_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(answers, "FOLDER", tmp_path)
    for setting in answers.SETTINGS:
        shutil.copy(KEPT / f"{setting}.csv.xz", tmp_path)
    answers.main(["--markdown"])
    numbers, _, rest = capsys.readouterr().out.partition(f"{tmp_path}/numbers_answers.csv\n")
    pixels, _, both = rest.partition(f"{tmp_path}/pixels_answers.csv\n")
    assert kept_block("numbers") == numbers.strip()
    assert kept_block("pixels") == pixels.partition("\n")[2].strip()
    assert kept_block("both") == both.partition("\n")[2].strip()
    for setting in answers.SETTINGS:
        name = f"{setting}_answers.csv"
        assert (tmp_path / name).read_bytes() == (KEPT / name).read_bytes()


def test_one_setting_alone_needs_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(answers, "FOLDER", tmp_path)
    shutil.copy(KEPT / "pixels.csv.xz", tmp_path)
    answers.main(["pixels", "--markdown"])
    assert capsys.readouterr().out.startswith(kept_block("pixels"))


def test_power_is_simulated_for_one_observation(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        answers.main(["both", "--power"])
    assert stopped.value.code == 1
    assert "--power with both; allowed: with numbers or pixels" in capsys.readouterr().err


def kept_block(name: str) -> str:
    """Return what the page has between its marks."""
    kept = re.search(rf"<!-- begin: {name} -->\n(.*?)<!-- end -->", PAGE.read_text(), re.S)
    assert kept is not None
    return kept[1].strip()


@pytest.mark.parametrize(("setting", "block"), [("numbers", "power"), ("pixels", "power_pixels")])
def test_its_power_is_what_the_simulation_says(
    setting: str, block: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(power, "FOLDER", ROOT / "outputs/sources")
    answers.main([setting, "--power", "--markdown"])
    assert kept_block(block) == capsys.readouterr().out.strip()


@pytest.mark.parametrize(("folder", "below"), [("ppo", 9), ("n_step", 0)])
def test_what_another_learner_says_is_what_its_kept_study_answers(folder: str, below: int) -> None:
    told, study = kept_block(folder), read_study(KEPT / folder)
    assert len(re.findall(NUMBERS, told)) == 4
    wrong = re.sub(rf"{NUMBER}(?!\d)", lambda m: "+9." + m[0].partition(".")[2], told)
    assert rewrite(wrong, study) == told
    words = ["low: FTW above scratch (greedy area)", "low: scratch (greedy area)"]
    gain, scratch = ask.answers(study, words, 10)
    assert len(gain.differences) == 10 and sum(value < 0 for value in gain.differences) == below
    text = PAGE.read_text().partition("### With PPO")[2].partition("<!--")[0]
    assert f"{scratch.estimate.value:.2f}" in text
