"""`python -m ship_trl exam`: a table, a map, a row for each cell, and failures as a suite."""

import csv
from pathlib import Path

import pytest
from PIL import Image

from ship_trl.cli import evaluate
from ship_trl.cli.exam import main
from ship_trl.sim.cases import load_suite, load_world
from tests.command import refused


def test_failures_are_shown_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf/suite").mkdir(parents=True)
    files = ("--csv", "cells.csv", "--picture", "map.png", "--write", "conf/suite/hard.yaml", "--worst", "12")
    main(["apf", "--scenes", "1500", *files])
    told = capsys.readouterr().out
    assert told.startswith("1500 scenes of one target ship in ")
    (line,) = (one.split() for one in told.splitlines() if one.startswith("apf") and " all " in one)
    with Path("cells.csv").open() as file:
        cells = list(csv.DictReader(file))
    scenes, unsolvable, *ends = (
        sum(int(cell[name]) for cell in cells) for name in ("scenes", "unsolvable", "collision", "timeout")
    )
    assert scenes == 1500 and int(line[2]) == scenes - unsolvable < scenes
    assert float(line[3].rstrip("%")) == pytest.approx(100 * sum(ends) / int(line[2]), abs=0.01)
    with Image.open("map.png") as picture:
        assert picture.width == 1280
    suite = load_suite("hard", load_world())
    assert [case.name for case in suite.cases] == [f"hard_{k}" for k in range(12)]
    # One of each cell, and the policy fails there.
    evaluate.main(["apf", "target=hard", "--markdown"])
    assert "| apf | 0% (0 to 24) |" in capsys.readouterr().out
    assert "--write: must be a new file" in refused(capsys, main, "vo", "--write", "conf/suite/hard.yaml")


def test_an_adversary_is_compared_with_random_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf/suite").mkdir(parents=True)
    words = ("--adversary", "3", "--searches", "5", "--tries", "200", "--write", "conf/suite/found.yaml")
    main(["keep_course", *words])
    told = capsys.readouterr().out
    rows = [line.split() for line in told.splitlines() if line.startswith("keep_course")]
    ends = ["5", "of", "5", "5", "1", "1"]
    assert [row[1:] for row in rows] == [["random", *ends], ["adversary", *ends]]
    suite = load_suite("found", load_world())
    assert [len(case.target_ships) for case in suite.cases] == 5 * [3]
    main(
        ["keep_course+shield", "--adversary", "1", "--searches", "2", "--tries", "8", "--write", "none.yaml"]
    )
    told = capsys.readouterr().out
    assert told.count("more than 8") == 4 and "nothing failed" in told and not Path("none.yaml").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("vo target=imazu", "target: must be a suite of random encounters, got imazu"),
        ("vo --adversary 4", "--adversary: must be"),
        ("vo --adversary 2 --csv a.csv", "--csv, --picture: of the exam; allowed without --adversary"),
        ("vo apf --write a.yaml", "--write: must be of one policy, got 2"),
        ("vo target=traffic_reacting --write a.yaml", "--write: must be of a suite whose ships hold"),
        ("vo target=traffic,traffic_dense", "target: several suites or worlds; allowed: one"),
        ("vo --scenes 0", "--scenes: must be"),
        ("nobody", "policy: no nobody; allowed:"),
    ],
)
def test_wrong_input_is_refused(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in refused(capsys, main, *words.split())
