"""How alike the layers of a study's networks are, measured by the real commands at smoke size."""

import json
import shutil
from pathlib import Path

import pytest

from ship_trl.cli.report import main as report
from ship_trl.study.records.layers import LAYERS, read_layers
from tests.command import ship_trl
from tests.study.commands import SMALL, study

STUDY = Path("outputs/smoke_study")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a study of two seeds lies, whose layers were looked at."""
    place = tmp_path_factory.mktemp("place")
    study(*SMALL, "arms=[scratch,FE2]", folder=place)
    ship_trl(str(STUDY), LAYERS, folder=place, verb="layers")
    return place


def test_each_network_stands_beside_its_source_and_scratch(folder: Path) -> None:
    rows = read_layers(folder / LAYERS)
    layers = {row.layer for row in rows}
    assert layers == {"conv1", "conv2", "conv3", "conv4", "shared"}
    assert {(row.arm, row.beside) for row in rows} == {
        *(("FE2", beside) for beside in ("source", "scratch")),
        *(("scratch", beside) for beside in ("source", "other seed", "untrained")),
    }
    assert len(rows) == len({row[:5] for row in rows}) and {row.pair for row in rows} == {"high"}
    copied = [row.cka for row in rows if (row.arm, row.beside) == ("FE2", "source")][:2]
    assert copied == pytest.approx([1.0, 1.0])
    others = [row.cka for row in rows if row.beside in ("scratch", "other seed")]
    assert all(value < 0.999 for value in others)
    # The first has none before it, so that a seed stands beside the same one whenever it is added.
    assert {row.seed for row in rows if row.beside == "other seed"} == {1}


def test_a_seed_is_added_to_those_that_are_there(folder: Path, tmp_path: Path) -> None:
    place = tmp_path / "again"
    shutil.copytree(folder, place)
    lines = (place / LAYERS).read_text().splitlines(keepends=True)
    (place / LAYERS).write_text("".join(line for line in lines if not line.startswith("1,")))
    done = ship_trl(str(STUDY), LAYERS, folder=place, verb="layers")
    assert (place / LAYERS).read_text() == "".join(lines)
    assert "seed 1: " in done.stdout and "seed 0: " not in done.stdout


def test_what_was_measured_is_kept_where_a_later_seed_is_damaged(folder: Path, tmp_path: Path) -> None:
    place = tmp_path / "again"
    shutil.copytree(folder / STUDY, place / STUDY)
    (place / STUDY / "pairs/high/FE2/seed=1/policy.safetensors").write_bytes(b"\x80")
    done = ship_trl(str(STUDY), LAYERS, folder=place, verb="layers", code=1)
    assert done.stderr.startswith("ship_trl: ") and done.stderr.count("\n") == 1
    assert {row.seed for row in read_layers(place / LAYERS)} == {0}


def test_a_strangers_study_runs_no_code(folder: Path, tmp_path: Path) -> None:
    place = tmp_path / "again"
    shutil.copytree(folder / STUDY, place / STUDY)
    (place / "evil.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    path = place / STUDY / "pairs/high/FE2/seed=0/result.json"
    values = json.loads(path.read_text())
    path.write_text(json.dumps(values | {"source_network": f"{place / 'evil.py'}:run"}))
    done = ship_trl(str(STUDY), LAYERS, folder=place, verb="layers", code=1)
    assert done.stderr.startswith("ship_trl: folder: ") and done.stderr.count("\n") == 1
    assert not (tmp_path / "ran").exists()


def test_seeds_whose_networks_are_gone_are_kept(folder: Path, tmp_path: Path) -> None:
    place = tmp_path / "again"
    shutil.copytree(folder, place)
    before = (place / LAYERS).read_bytes()
    for network in (place / STUDY / "pairs").rglob("policy.safetensors"):
        network.unlink()
    ship_trl(str(STUDY), LAYERS, folder=place, verb="layers")
    assert (place / LAYERS).read_bytes() == before
    done = ship_trl(str(STUDY), "new.csv", folder=place, verb="layers", code=1)
    assert done.stderr.startswith("ship_trl: folder: ") and done.stderr.count("\n") == 1
    assert not (place / "new.csv").exists()
    (place / LAYERS).write_text("seed,pair\n0,high\n")
    done = ship_trl(str(STUDY), LAYERS, folder=place, verb="layers", code=1)
    assert done.stderr.startswith(f"ship_trl: table: {LAYERS} is not a table of layers")


def test_the_report_draws_what_lies_beside_the_runs(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "study"
    shutil.copytree(folder / STUDY, place)
    report([str(place)])
    assert not (place / "report/layers.png").exists()
    shutil.copy(folder / LAYERS, place / LAYERS)
    report([str(place)])
    drawn = (place / "report/layers.png").read_bytes()
    assert len(drawn) > 5_000 and capsys.readouterr().err == ""
    # Of a run that the study has not nothing is drawn.
    with (place / LAYERS).open("a") as file:
        file.write("7,high,FE2,source,conv1,0.5\n")
    report([str(place)])
    assert "1 of 46 rows are of runs that are not there; left out" in capsys.readouterr().err
    assert (place / "report/layers.png").read_bytes() == drawn
    (place / LAYERS).write_bytes(b"\x80")
    report([str(place)])
    assert f"{place / LAYERS}: " in capsys.readouterr().err
    assert not (place / "report/layers.png").exists()
