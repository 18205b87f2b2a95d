"""What each transfer gained, written by the report, and what is recommended by it."""

import csv
from pathlib import Path

import pytest

from ship_trl.cases import main as cases
from ship_trl.report import main as report
from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.plan.config import to_study
from ship_trl.study.plan.jobs import plan_jobs
from ship_trl.study.plan.manifest import write_plan
from tests.study.synthetic import write_planned

SEEDS = 3


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The table of a study in which finetuning learns sooner, the sooner the more layers."""
    folder = tmp_path_factory.mktemp("study")
    config = to_study(["profile=quick", f"seeds={SEEDS}", f"output={folder}"])
    write_plan(plan_jobs(config), config)
    write_planned(folder, SEEDS, 120)
    report([str(folder)])
    return folder / "report/transfers.csv"


def test_each_transfer_is_there_once_by_what_its_cases_are(table: Path) -> None:
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
    assert row["seeds"] == str(SEEDS) and float(row["low"]) <= float(row["gain"]) <= float(row["high"])


def test_what_gains_most_for_sure_is_recommended(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with table.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if (row["source"], row["target"]) == ("3", "4")]
    # One that gained more, but by chance.
    lucky = {**rows[0], "arm": "FT9", "gain": "0.9", "low": "-0.1", "high": "1.9"}
    given = tmp_path / "given.csv"
    for row in rows:
        row |= {"low": "0.01"} if row["arm"] != "FT2" else {"low": "0.02"}
    write(given, [*rows, lucky])
    cases(["--target", "4", "--no-picture", "--measured", str(given)])
    assert "python -m ship_trl source=3 target=4 +arm=FT2" in capsys.readouterr().out.splitlines()
    write(given, [lucky])
    cases(["--target", "4", "--no-picture", "--measured", str(given)])
    assert "python -m ship_trl target=4 method=scratch" in capsys.readouterr().out.splitlines()
    cases(["--target", "6", "--no-picture", "--measured", str(given)])
    assert "no transfer to case 6 was measured" in capsys.readouterr().out


def write(path: Path, rows: list[dict[str, str]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
