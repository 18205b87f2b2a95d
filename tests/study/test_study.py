"""The real command: a small study, one that is killed and goes on, and what it refuses."""

import json
import random
import shutil
import time
from pathlib import Path

import pytest

from ship_trl.study.launch import last_episode
from tests.command import SMOKE, files, report
from tests.forked import Running
from tests.study.commands import SMALL, learned, own_study, study


def test_a_study_ends_with_all_its_results(whole: Path) -> None:
    place = whole / "outputs/smoke_study"
    found = sorted(str(p.parent.relative_to(place)) for p in place.rglob("result.json"))
    assert found == [
        *(f"pairs/high/{arm}/seed={seed}" for arm in ("FTW", "scratch") for seed in (0, 1)),
        *(f"sources/1/scratch/seed={seed}" for seed in (0, 1)),
    ]
    assert len(json.loads((place / "study.json").read_text())["jobs"]) == 6


def test_started_again_it_trains_nothing(whole: Path) -> None:
    before = files(whole)
    started = time.monotonic()
    done = study(*SMALL, folder=whole)
    assert '"missing": 0' in done.stdout and time.monotonic() - started < 30
    assert files(whole) == before


@pytest.mark.long
def test_killed_and_started_again_it_ends_alike(whole: Path, tmp_path: Path) -> None:
    running = Running(("study", "run", *SMALL), tmp_path)
    # While it trains, anywhere: the time is not important, and printed if it ever is.
    while not list(tmp_path.rglob("curve.csv")):
        time.sleep(0.1)
        assert running.child.poll() is None
    after = random.uniform(0, 10)
    running.finish(after)
    study(*SMALL, folder=tmp_path)
    assert learned(tmp_path) == learned(whole), f"killed after {after} s"


@pytest.mark.long
def test_damaged_runs_are_kept_and_trained_again(whole: Path, tmp_path: Path) -> None:
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    arm = tmp_path / "outputs/smoke_study/pairs/high/FTW"
    (arm / "seed=0/curve.csv").write_text("episode\n")
    (arm / "seed=1/result.json").write_text('{"arm": "FTW"')
    done = study(*SMALL, folder=tmp_path)
    assert done.stdout.count("trained again") == 2 and "2 of 6 runs to do" in done.stdout
    assert (arm / "damaged-1-seed=0/curve.csv").read_text() == "episode\n"
    found = {name: data for name, data in learned(tmp_path).items() if "damaged" not in name}
    assert found == learned(whole)


def test_other_settings_are_refused_and_lose_nothing(whole: Path) -> None:
    before = files(whole)
    done = study(*SMALL, "overrides=[learn.lr=0.1]", folder=whole, code=1)
    assert done.stderr.strip() == (
        "ship_trl: output: outputs/smoke_study holds a study with other settings (learn); "
        "allowed: another output=FOLDER"
    )
    assert files(whole) == before


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("overrides=[learn.typo=1]", "learn.typo: unknown key"),
        ("overrides=[learn.lr=-1]", "learn.lr: must be greater than 0"),
        ("profile=endless", "profile: no endless"),
        ("output=/proc/nowhere", "output: /proc/nowhere cannot be written"),
    ],
)
def test_bad_input_is_one_line(override: str, said: str, tmp_path: Path) -> None:
    done = study(override, folder=tmp_path, code=1)
    assert done.stderr.startswith("ship_trl: ") and said in done.stderr and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_last_whole_line_tells_how_far_a_run_is(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    assert last_episode(path) == 0
    path.write_text("episode,return\n")
    assert last_episode(path) == 0
    path.write_text("episode,return\n1,2.0\n2,3.0\n34")
    assert last_episode(path) == 2


@pytest.mark.long
def test_a_study_of_ones_own_pair_ends_in_a_page_of_its_question(tmp_path: Path) -> None:
    own_study(tmp_path)
    line = "harbour.yaml", f"overrides=[{','.join(SMOKE[1:])}]"
    done = study(*line, folder=tmp_path, pictures=True)
    place = tmp_path / "outputs/harbour"
    assert '"missing": 0' in done.stdout
    assert "FT3 against scratch, case 3 to case mine, 2 seeds" in done.stdout
    page = (place / "report/index.html").read_text()
    assert "<h1>Help: from case 3?</h1>" in page and "claim" not in page.partition("</style>")[2]
    pictures = {path.stem for path in (place / "report").glob("*.png")}
    assert pictures == {"cases", "effects", "pair_harbour", "differences", "times"}
    # Made again, it has the same bytes.
    before = files(place / "report")
    report([str(place)])
    assert files(place / "report") == before
