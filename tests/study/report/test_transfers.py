"""What each transfer gained, and what is recommended by it."""

import csv
from pathlib import Path

import numpy as np
import pytest

from ship_trl.cli.cases import main as cases
from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.manifest import write_plan
from ship_trl.study.metrics import measure
from ship_trl.study.plan import plan_jobs, to_study
from ship_trl.study.report.tables import transfer_rows, write_csv
from ship_trl.study.statistics import estimate_mean
from ship_trl.study.study import Study, read_study
from tests.study.synthetic import write_planned

# The least of which an interval is given, and one that was run later.
SEEDS = 5


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    folder = tmp_path_factory.mktemp("study")
    parts = ("pairs=[high,low]", "controls=false")
    config = to_study(["profile=quick", f"seeds={SEEDS}", f"output={folder}", *parts])
    write_plan(plan_jobs(config), config)
    write_planned(folder, SEEDS + 1, 120, *parts)
    return read_study(folder)


@pytest.fixture(scope="module")
def table(study: Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("table") / "transfers.csv"
    write_csv(path, transfer_rows(study))
    return path


def test_each_transfer_is_there_once_by_what_its_cases_are(table: Path, study: Study) -> None:
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    found = {(row["source"], row["target"], row["arm"], row["epsilon_start"]): row for row in rows}
    assert len(found) == len(rows)
    arms = {arm for source, target, arm, _ in found if (source, target) == ("3", "4")}
    assert arms == {*(f"{kind}{n}" for kind in ("FE", "FT") for n in range(1, 5)), "FTW"}
    # Alike for all sources of the new case: networks of one training, from the low epsilon.
    new = {key for key in found if key[1] == "new"}
    assert new == {(source, "new", "FTW", "0.1") for source in "123456"}
    row = found["3", "4", "FTW", ""]
    world = load_world()
    assert row["source_fingerprint"] == load_case("3", world).fingerprint
    assert row["target_fingerprint"] == load_case("4", world).fingerprint
    assert row["profile"] == "quick" and row["seeds"] == str(SEEDS)
    whole, scratch = (study.arm("pairs", "low", arm) for arm in ("FTW", "scratch"))
    differences = [measure(whole[seed], "area") - measure(scratch[seed], "area") for seed in range(SEEDS)]
    # Those to case 4, whose intervals hold together.
    among = sum(target == "4" for _, target, *_ in found)
    wanted = estimate_mean(np.array(differences), 0.025 / among)
    assert [float(row[end]) for end in ("low", "gain", "high")] == pytest.approx(
        [wanted.low, wanted.value, wanted.high], abs=1e-4
    )


def test_transfers_of_few_seeds_are_left_out(study: Study) -> None:
    assert transfer_rows(study.first(SEEDS - 1, study.level)) == []


def test_the_transfer_that_is_shown_to_gain_most_is_recommended(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with table.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if (row["source"], row["target"]) == ("3", "4")]
    # One that gained more, but by chance.
    lucky = {**rows[0], "arm": "FE4", "gain": "0.9", "low": "-0.1", "high": "1.9"}
    others = [row | {"low": "0.01"} for row in rows if row["arm"] not in ("FE4", "FT2")]
    best = next(row for row in rows if row["arm"] == "FT2") | {"low": "0.02"}
    given = tmp_path / "given.csv"

    def said(target: str, *rows: dict[str, str]) -> list[str]:
        write_csv(given, rows)
        cases([f"target={target}", "--measured", str(given)])
        *lines, picture = capsys.readouterr().out.splitlines()
        assert picture == f"outputs/case_{target}.png"
        return lines

    def wide(row: dict[str, str]) -> dict[str, str]:
        return row | {"gain": "0.5", "high": "0.9"}

    line = "python -m ship_trl profile=quick source=3 target=4 +arm=FT2"
    assert said("4", *map(wide, others), wide(best), lucky)[-1] == line
    assert said("4", lucky)[-1] == "python -m ship_trl target=4 method=scratch"
    # Of another target nothing was measured.
    assert "expected gain" in said("6", lucky)[-4]
