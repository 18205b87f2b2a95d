"""The table of finished runs."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ship_trl.cli.results import main
from ship_trl.files.curve import GREEDY, TRAINING, write_curve
from ship_trl.files.record import RunRecord, SourceReturns, read_run
from ship_trl.study.report.tables import STABILITY_HEADINGS, measure_runs, stability_rows
from ship_trl.view import charts
from tests.a_result import a_result, an_evaluation
from tests.study.synthetic import BEST, write_run


def write(folder: Path, seed: int, best: float, outcome: str = "goal") -> None:
    place = folder / f"4/scratch/seed={seed}"
    place.mkdir(parents=True)
    score = an_evaluation(best, outcome)
    made = a_result(
        pair="4", arm="scratch", target="4", seed=seed, best=score, final=score, best_known_return=40.0
    )
    made.write(place)


def test_one_row_for_each_arm_with_its_seeds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, 0, 30.0)
    write(tmp_path, 10, 20.0)
    write(tmp_path, 2, -300.0, "collision")
    main([str(tmp_path), "--markdown", "--all"])
    returns = "20.0 (-300.0 to 30.0) | 30.0 -300.0 20.0"
    assert capsys.readouterr().out.splitlines()[2] == (
        f"| 4 scratch | 3 | 0 2 10 | 40.0 | {returns} | - | 2 of 3 | {returns} | 2 of 3 | -, -, - |"
    )
    main([str(tmp_path), "--markdown"])
    assert capsys.readouterr().out.splitlines()[2] == (
        "| 4 scratch | 3 | 20.0 (-300.0 to 30.0) | 20.0 (-300.0 to 30.0) | 2 of 3 |"
    )


def test_a_broken_result_is_named_and_the_rest_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, 0, 30.0)
    for name, text in (("cut", '{"pair": '), ("foreign", "[1]"), ("other", "{}")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "result.json").write_text(text)
    main([str(tmp_path), "--markdown"])
    said = capsys.readouterr()
    assert said.err.count("; left out") == 3 and "4 scratch" in said.out


def test_a_path_with_an_equals_sign_is_no_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, 0, 30.0)
    folder = tmp_path / "4/scratch/seed=0"
    with pytest.raises(SystemExit):
        main([str(folder.with_name("seed=9"))])
    assert "no finished run below" in capsys.readouterr().err
    main([str(folder), "--csv", str(folder / "runs.csv")])
    assert "scratch" in capsys.readouterr().out


def test_a_copy_is_no_further_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, 0, 30.0)
    shutil.copytree(tmp_path / "4", tmp_path / "4 again")
    # The same seed on another machine, say, may end otherwise.
    write(tmp_path / "other", 0, 20.0)
    (tmp_path / "other/4").rename(tmp_path / "4 elsewhere")
    main([str(tmp_path), "--markdown", "--all"])
    said = capsys.readouterr()
    assert "| 4 scratch | 2 | 0 0 | 40.0 | 25.0 (20.0 to 30.0) | 30.0 20.0 |" in said.out
    copies = [tmp_path / f"{name}/scratch/seed=0" for name in ("4 again", "4")]
    assert said.err == f"ship_trl: {copies[0]} is a copy of {copies[1]}; left out\n"
    # Two folders that are compared may hold the same run.
    main([str(tmp_path / "4"), str(tmp_path / "4 again"), "--markdown"])
    assert capsys.readouterr().out.count("scratch | 1 | 30.0 |") == 2


def write_rows(folder: Path, seed: int, rows: list[tuple[str, int, float]]) -> None:
    """A learning curve of rows kind, episode and return."""
    table = pd.DataFrame(rows, columns=["kind", "episode", "return"])
    write_curve(folder / f"4/scratch/seed={seed}", table.assign(epsilon=0.1, outcome="goal", dcpa=60.0))


def test_curves_of_two_folders_are_drawn_beside_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    titles: list[str] = []
    draw = charts.draw_comparison

    def spy(path: Path, panels: Mapping[str, charts.Groups]) -> None:
        titles.extend(panels)
        draw(path, panels)

    monkeypatch.setattr(charts, "draw_comparison", spy)
    for name in ("one", "two"):
        write(tmp_path / name, 0, 30.0)
        rows = [(GREEDY, 0, -300.0), (TRAINING, 1, -250.0), (TRAINING, 2, 10.0), (GREEDY, 2, 20.0)]
        write_rows(tmp_path / name, 0, rows)
    write(tmp_path / "two", 1, 20.0)  # without a learning curve
    one, two, picture = (str(tmp_path / name) for name in ("one", "two", "both.png"))
    main([one, two, "--markdown", "--picture", picture])
    said = capsys.readouterr()
    assert f"| {one}: 4 scratch | 1 |" in said.out and f"| {two}: 4 scratch | 2 |" in said.out
    assert said.out.splitlines()[-1] == picture
    assert said.err.count("\n") == 1 and "seed=1: curve.csv is missing; left out" in said.err
    assert Path(picture).read_bytes().startswith(b"\x89PNG")
    assert titles == ["case 4"]


def curve(folder: Path, seed: int, greedy: list[float]) -> None:
    """A run with so many greedy evaluations."""
    write(folder, seed, 30.0)
    numbered = list(enumerate(greedy, 1))
    rows = [row for n, value in numbered for row in ((TRAINING, n, -10.0), (GREEDY, n, value))]
    write_rows(folder, seed, rows)


def test_two_folders_are_tested_against_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for seed in range(4):
        curve(tmp_path / "a", seed, [seed, seed + 2.0])
        curve(tmp_path / "b", seed, [seed + 50.0, seed + 52.0])
        curve(tmp_path / "c", seed, [seed + 0.5, seed + 1.5])
    main([str(tmp_path / "a"), str(tmp_path / "b"), "--markdown", "--test"])
    # Of the 70 ways to part eight runs, two part them so far: 2/70.
    assert "| 4 scratch | 1.0 2.0 3.0 4.0 | 51.0 52.0 53.0 54.0 | 0.03 |" in capsys.readouterr().out
    main([str(tmp_path / "a"), str(tmp_path / "c"), "--markdown", "--test"])
    assert "| 4 scratch | 1.0 2.0 3.0 4.0 | 1.0 2.0 3.0 4.0 | 1.00 |" in capsys.readouterr().out


def test_the_usual_metrics_of_transfer_are_one_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = SourceReturns(90.0, 0.0, 0.0, -10.0, -100.0, 100.0)
    for seed in range(3):
        scores = np.full(50, 0.4 + 0.1 * seed)
        write_run(tmp_path, scores, arm="scratch", seed=seed)
        write_run(tmp_path, (1 + scores) / 2, arm="FT3", seed=seed, before=0.3, on_source=source)
        write_run(tmp_path, (1 + scores) / 2, arm="scratch-demonstrations", seed=seed)
    main([str(tmp_path), "--markdown", "--transfer"])
    lines = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.split("\n\n")[1].splitlines()]
    table = {line[0]: dict(zip(lines[0][1:], line[1:], strict=True)) for line in lines}
    assert table["high FT3"] == {
        "seeds": "3", "start": "0.30", "early area": "0.75", "area": "0.75", "greedy area": "0.64",
        "time": "0.04", "asymptote": "0.75", "success": "0.00", "forgetting": "0.50", "total time": "1.04",
        # Each seed gains half of what scratch leaves.
        "forward transfer": "0.50 (0.50 to 0.50)",
    }  # fmt: skip
    shown = table["high scratch-demonstrations"]
    assert (shown["total time"], shown["forward transfer"]) == ("0.04", "0.50 (0.50 to 0.50)")
    assert (table["high scratch"]["forgetting"], table["high scratch"]["forward transfer"]) == ("-", "-")


def test_runs_of_other_settings_are_not_pooled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arm, rate, score in (("scratch", 1e-4, 0.5), ("FT3", 1e-4, 0.75), ("FT3", 1e-2, 0.1)):
        for seed in (0, 1) if rate == 1e-4 else (2,):
            place = write_run(tmp_path, np.full(50, score + 0.01 * seed), arm=arm, seed=seed)
            told = f"seed: {seed}\nlearn:\n  lr: {rate}\n  batch_size: 32\n"
            (place / "config.yaml").write_text(told)
    files = [str(tmp_path / name) for name in ("curves.png", "runs.csv")]
    main([str(tmp_path), "--markdown", "--transfer", "--picture", files[0], "--csv", files[1]])
    table, transfer, written = capsys.readouterr().out.split("\n\n")
    names = ["high FT3", "high FT3 learn.lr=0.01", "high scratch"]
    assert [line.split(" | ")[0].strip("| ") for line in table.splitlines()[2:]] == names
    rows = {line.split(" | ")[0].strip("| "): line.split(" | ") for line in transfer.splitlines()[2:]}
    # No run from scratch has the settings of the second row.
    assert sorted(rows) == names and rows[names[0]][-1].startswith("0.5") and rows[names[1]][-1] == "- |"
    assert pd.read_csv(files[1])["run"].value_counts().to_dict() == dict(zip(names, (2, 1, 2), strict=True))
    assert written.splitlines()[-2:] == files


def result(folder: Path, scores: list[float], seed: int) -> RunRecord:
    # A score of 1 is the best known return, 0.9 a return of half of it.
    best = an_evaluation(BEST)
    return read_run(write_run(folder, np.array(scores), seed=seed, every=5, best=best, final=best))


def table(groups: dict[str, list[RunRecord]]) -> list[list[str]]:
    return list(stability_rows(list(measure_runs(groups))))


def row(found: list[str]) -> dict[str, str]:
    return dict(zip(STABILITY_HEADINGS, found, strict=True))


def test_falls_and_last_networks_are_counted(tmp_path: Path) -> None:
    steady, fallen = [0.5] * 9 + [1.0] * 41, [0.5] * 9 + [1.0] * 20 + [0.1] * 15 + [0.9] * 5
    (found,) = table({"a": [result(tmp_path, steady, 0), result(tmp_path, fallen, 1)]})
    told = row(found)
    assert (told["runs"], told["fell"], told["last near best"]) == ("2", "1", "1 of 2")
    assert told["best of known"].startswith("1.000 ± 0.000") and told["last of known"] == "0.750 (median)"
    means = [np.mean(scores) for scores in (steady, fallen)]
    assert told["area"] == f"{np.mean(means):.3f} ± {np.std(means, ddof=1):.3f}"


def test_one_run_has_no_spread_and_a_broken_one_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = result(tmp_path, [1.0] * 20, 1)
    (broken.folder / "curve.csv").write_text("episode")
    found = table({"a": [result(tmp_path, [1.0] * 20, 0), broken], "b": [broken]})
    assert [line[0] for line in found] == ["a"] and "±" not in "".join(found[0])
    assert capsys.readouterr().err.count("curve.csv") == 2


def test_the_command_prints_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for seed in (0, 1):
        result(tmp_path, [0.5] * 9 + [1.0] * 11, seed)
    main([str(tmp_path), "--stability", "--markdown"])
    printed = capsys.readouterr().out
    assert "| " + " | ".join(STABILITY_HEADINGS) + " |" in printed and "| high scratch | 2 | 0 | " in printed


def test_every_number_of_every_run_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for seed in (0, 1):
        result(tmp_path / "runs", [0.5] * 9 + [1.0] * 11, seed)
    main([str(tmp_path / "runs"), "--csv", str(tmp_path / "numbers.csv")])
    rows = pd.read_csv(tmp_path / "numbers.csv")
    assert list(zip(rows["run"], rows["seed"], strict=True)) == [("high scratch", 0), ("high scratch", 1)]
    assert rows["area"].to_list() == pytest.approx([0.775] * 2) and (rows["best of known"] == 1).all()
    main([str(tmp_path / "runs"), "--csv", str(tmp_path / "new/folder/numbers.csv")])
    assert (tmp_path / "new/folder/numbers.csv").read_bytes() == (tmp_path / "numbers.csv").read_bytes()
    with pytest.raises(SystemExit):
        main([str(tmp_path / "runs"), "--csv", str(tmp_path / "numbers.csv/numbers.csv")])
    assert "--csv: must be in a folder; a new one is made" in capsys.readouterr().err
