"""How steadily runs learn, on runs whose falls are known."""

import csv
from pathlib import Path

import numpy as np
import pytest

from ship_trl.cli.results import main
from ship_trl.files.record import RunRecord, read_run
from ship_trl.study.report.tables import STABILITY_HEADINGS, measure_runs, stability_rows
from tests.a_result import an_evaluation
from tests.study.synthetic import BEST, write_run


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
    with (tmp_path / "numbers.csv").open(newline="") as file:
        rows_ = list(csv.DictReader(file))
    assert [(row["run"], row["seed"]) for row in rows_] == [("high scratch", "0"), ("high scratch", "1")]
    assert all(
        float(row["area"]) == pytest.approx(0.775) and float(row["best of known"]) == 1 for row in rows_
    )
    with pytest.raises(SystemExit):
        main([str(tmp_path / "runs"), "--csv", str(tmp_path / "nowhere/numbers.csv")])
    assert "--csv: must be in a folder that exists" in capsys.readouterr().err
