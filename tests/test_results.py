"""The table of finished runs."""

import json
from pathlib import Path

import pytest

from ship_trl.results import collect, main


def write(folder: Path, seed: int, best: float, outcome: str = "goal") -> None:
    place = folder / f"4/scratch/seed={seed}"
    place.mkdir(parents=True)
    score = {"return": best, "outcome": outcome}
    values = {
        "pair": "4",
        "arm": "scratch",
        "target": "4",
        "seed": seed,
        "best": score,
        "final": score,
        "profile": "quick",
    }
    (place / "result.json").write_text(json.dumps(values | {"best_known_return": 40.0}))


def test_one_row_for_each_arm_with_its_seeds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, 0, 30.0)
    write(tmp_path, 10, 20.0)
    write(tmp_path, 2, -300.0, "collision")
    main([str(tmp_path), "--markdown"])
    rows = capsys.readouterr().out.splitlines()
    assert (
        rows[2] == "| 4 scratch | 0 2 10 | 40.0 | 30.0 -300.0 20.0 | - | 2 of 3 | 30.0 -300.0 20.0 | 2 of 3 |"
    )


def test_share_is_of_the_worst_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, 0, 30.0)
    write(tmp_path, 1, 20.0)
    main([str(tmp_path), "--markdown", "--arm", "scratch"])
    assert "| at least 50% | 2 of 2 |" in capsys.readouterr().out


def test_a_broken_result_is_named_and_the_rest_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, 0, 30.0)
    for name, text in (("cut", '{"pair": '), ("foreign", "[1]"), ("other", "{}")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "result.json").write_text(text)
    found, broken = collect(tmp_path)
    assert len(found) == 1 and len(broken) == 3
    main([str(tmp_path), "--markdown"])
    said = capsys.readouterr()
    assert said.err.count("is not a whole result and is left out") == 3 and "4 scratch" in said.out


def test_an_empty_folder_is_one_line_and_exit_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main([str(tmp_path)])
    assert caught.value.code == 1
    assert capsys.readouterr().err.startswith("ship_trl: folder: no finished run below")
