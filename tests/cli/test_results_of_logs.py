"""`results NAME=FILE` compares learning curves of any library."""

import csv
import re
from pathlib import Path

import pytest

from ship_trl.cli.results import main
from ship_trl.files.record import SourceReturns
from tests.a_result import a_result
from tests.command import refused


def write(name: str, slope: float, seeds: int = 3) -> None:
    """Write runs whose return rises by `slope` a step from their seed to 100 at most."""
    lines = [
        f"{seed},{step},{min(100.0, seed + slope * step)}"
        for seed in range(seeds)
        for step in range(0, 1001, 10)
    ]
    Path(name).write_text("\n".join(["seed,step,return", *lines]) + "\n")


def table(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[dict[str, list[str]], str]:
    main([*words, "--markdown"])
    printed = capsys.readouterr().out
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in printed.splitlines() if "|" in line
    ]
    return {row[0]: row[1:] for row in rows}, printed


def test_a_steeper_curve_gains(capsys: pytest.CaptureFixture[str]) -> None:
    write("slow.csv", 0.1)
    write("fast.csv", 0.2)
    rows, printed = table(capsys, "scratch=slow.csv", "FT3=fast.csv", "--low", "0", "--high", "100")
    assert rows["arm"] == ["runs", "start", "early area", "area", "time", "asymptote", "forward transfer"]
    value = {name: [cell.split(" ")[0] for cell in row] for name, row in rows.items()}
    # Means over the seeds 0, 1 and 2: slow (1 + 0.1 t) / 100 gives an area of 0.51.
    assert value["scratch"][:1] == ["3"] and value["scratch"][3:5] == ["0.51", "0.64"]
    # Fast reaches 1 at half time, so its area is 0.755; 0.65 is reached at about 0.32.
    assert value["FT3"][3:6] == ["0.76", "0.32", "1.00"]
    assert value["FT3 - scratch"][3:] == ["+0.25", "-0.32", "+0.04", "+0.50"]
    # Both arms' areas vary by as much, but the baseline's half as much in the ratio.
    assert re.fullmatch(r"\+0\.50 \(\+0\.4\d to \+0\.5\d\)", rows["FT3 - scratch"][-1])
    assert "the first 1,000 steps" in printed and "a score of 0.65" in printed
    # Areas of 0.505, 0.515 and 0.525: 4.30 standard errors with two degrees of freedom.
    assert rows["scratch"][3] == "0.51 (0.49 to 0.54)"


def test_runs_of_ours_have_success_and_forgetting(capsys: pytest.CaptureFixture[str]) -> None:
    source = SourceReturns(90.0, 0.0, 0.0, -10.0, -100.0, 100.0)
    for arm, rate, measured in (("scratch", 0.0, None), ("FT3", 1.0, source)):
        place = Path("out", arm)
        place.mkdir(parents=True)
        lines = [f"{step},{step / 10},{'' if step else rate}" for step in range(0, 1001, 10)]
        heading = "steps,return,greedy_success_rate"
        (place / "curve.csv").write_text("\n".join([heading, f"0,,{rate}", *lines]) + "\n")
        a_result(on_source=measured).write(place)
    rows, _ = table(capsys, "scratch=out/scratch/curve.csv", "FT3=out/FT3/curve.csv")
    assert rows["arm"][-3:] == ["greedy success", "forgetting", "forward transfer"]
    assert rows["scratch"][-3:] == ["0.00", "-", ""] and rows["FT3"][-3:] == ["1.00", "0.50", ""]
    assert rows["FT3 - scratch"][-3:] == ["+1.00", "-", "+0.00"]


def test_one_run_has_no_interval_and_every_run_its_row(capsys: pytest.CaptureFixture[str]) -> None:
    write("one.csv", 0.1, seeds=1)
    write("two.csv", 0.1, seeds=2)
    rows, _ = table(capsys, "a=one.csv", "b=two.csv", "--csv", "all.csv")
    assert "(" not in "".join(rows["a"]) and "(" in "".join(rows["b"])
    with Path("all.csv").open() as file:
        found = list(csv.DictReader(file))
    assert [(row["arm"], row["run"]) for row in found] == [
        ("a", "one.csv 0"),
        ("b", "two.csv 0"),
        ("b", "two.csv 1"),
    ]
    assert found[0]["area"] == found[1]["area"]


def test_a_pattern_is_several_files(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("x1.csv", "x2.csv", "y.csv"):
        write(name, 0.1, seeds=1)
    rows, _ = table(capsys, "a=x*.csv", "b=y.csv")
    assert (rows["a"][0], rows["b"][0]) == ("2", "1")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["a=slow.csv", "slow.csv"], "results: allowed: NAME=FILE, got slow.csv"),
        (["a=none*.csv"], "a: no file none*.csv"),
        (["a=slow.csv", "--low", "5", "--high", "5"], "--low: must be below --high, got 5 and 5"),
        (["a=slow.csv", "b=slow.csv"], "b: slow.csv is given twice; allowed: each run once"),
        (["a=slow.csv", "b=link.csv"], "b: link.csv is given twice; allowed: each run once"),
        (["a=slow.csv", "b=late.csv"], "b: late.csv has fewer than 10 returns in the first 1,000 steps"),
        (["a=slow.csv", "b=resumed.csv"], "b: resumed.csv begins at step 500 of the 1,000"),
        (["a=slow.csv", "--threshold", "2"], "--threshold: must be"),
    ],
)
def test_wrong_words_are_refused(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    write("slow.csv", 0.1)
    Path("late.csv").write_text("step,return\n5000,1\n6000,2\n")
    Path("link.csv").symlink_to("slow.csv")
    lines = [f"{step},1" for step in range(500, 1001, 10)]
    Path("resumed.csv").write_text("\n".join(["step,return", *lines]))
    assert told in refused(capsys, main, *words)
