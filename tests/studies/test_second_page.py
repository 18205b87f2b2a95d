"""The tables that are kept of the second study give the page."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ship_trl.cli.study import answers
from ship_trl.study.statistics import interquartile_mean
from ship_trl.study.study import Study, read_study
from studies.second import power, report
from studies.second.__main__ import main
from studies.second.plan import SETTINGS
from tests.command import ROOT
from tests.findings import NUMBER, NUMBERS, rewrite

KEPT = ROOT / "outputs/questions"
PAGE = ROOT / "studies/second/README.md"


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
    monkeypatch.setattr(power, "FOLDER", ROOT / "outputs/sources")
    main(["report", setting, "--power", "--markdown"])
    assert kept_block(block) == capsys.readouterr().out.strip()


@pytest.mark.parametrize("folder", ["ppo", "ppo_pixels", "n_step"])
def test_the_contrasts_of_another_learner_are_those_of_its_kept_study(folder: str) -> None:
    told = kept_block(folder)
    assert len(re.findall(NUMBERS, told)) == 4
    wrong = re.sub(rf"{NUMBER}(?!\d)", lambda m: "+9." + m[0].partition(".")[2], told)
    assert rewrite(wrong, read_study(KEPT / folder)) == told


def test_what_is_said_of_other_learners_follows_from_the_kept_studies() -> None:
    ppo, ppo_pixels, n_step = (read_study(KEPT / folder) for folder in ("ppo", "ppo_pixels", "n_step"))
    first = read_study(ROOT / "outputs/confirmatory")
    words = ["low: FTW above scratch (greedy area)", "low: scratch (greedy area)", "low: FTW (greedy area)"]
    (less, with_ppo, _), (seen, from_pixels, _), (more, with_n_step, _) = (
        answers(one, words, 10) for one in (ppo, ppo_pixels, n_step)
    )
    gain, with_one, _ = answers(first, words, 15)
    above = [sum(value > 0 for value in one.differences) for one in (less, seen, more, gain)]
    assert above == [1, 7, 10, 15]
    assert seen.high / (1 - from_pixels.value) == pytest.approx(1 / 3, abs=0.05)
    reach = [
        sum(
            bool(study.records["pairs", "low", "FTW", seed].greedy.goal[0])
            for seed in range(begin, begin + 10)
        )
        for study, begin in ((n_step, 4000), (ppo, 3000), (ppo_pixels, 5000))
    ]
    assert reach == [4, 0, 0]
    floored, before = {}, []
    for arm in ("FTW", "FT4"):
        pairs = [[greedy_scores(n_step, one, seed) for one in (arm, "scratch")] for seed in range(4000, 4010)]
        gains = [float(np.mean(np.maximum(one, 0) - np.maximum(other, 0))) for one, other in pairs]
        floored[arm] = (f"{interquartile_mean(np.array(gains)):.2f}", sum(value > 0 for value in gains))
    for seed in range(4000, 4010):
        one, other = (greedy_scores(n_step, arm, seed) for arm in ("FTW", "scratch"))
        change = min(int(np.flatnonzero(scores != scores[0])[0]) for scores in (one, other))
        gain_by_time = np.array([one - other, np.maximum(one, 0) - np.maximum(other, 0)])
        before.append((gain_by_time[:, :change].sum(1), gain_by_time.sum(1)))
    early, whole = np.sum(before, 0)
    share, floored_share = 100 * early / whole
    page = " ".join(PAGE.read_text().split())
    for sentence in (
        "from numbers it is below scratch in nine of ten seeds; from pixels it is above in seven",
        f"a third of the {1 - from_pixels.value:.2f} that scratch leaves is not excluded",
        "With three-step targets FTW gains in all ten seeds",
        "in 4 of 10 seeds with three-step targets, and in none with PPO",
        f"is {with_ppo.value:.2f} with PPO from numbers",
        f"{from_pixels.value:.2f} from pixels, and {with_n_step.value:.2f} with three-step",
        f"it is {with_one.value:.2f}, and FTW gains {gain.value:.2f} in 15 of 15 seeds",
        f"FTW gains {floored['FTW'][0]} in ten of ten seeds, FT4 {floored['FT4'][0]} in eight",
        f"{share:.0f} % of FTW's gain (floored: {floored_share:.0f} %).",
    ):
        assert sentence in page, sentence
    assert (floored["FTW"][1], floored["FT4"][1]) == (10, 8)


def greedy_scores(study: Study, arm: str, seed: int) -> NDArray[np.float64]:
    """Return the scores of a run's greedy evaluations, not floored."""
    record = study.records["pairs", "low", arm, seed]
    return record.score(record.greedy.returns)
