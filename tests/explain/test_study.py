"""CKA by layer of a study's networks, measured by the real commands at smoke size."""

import json
import shutil
from pathlib import Path

import pytest

from ship_trl.study.tables import LAYERS, read_layers
from tests.command import SMOKE, report, ship_trl
from tests.study.commands import SMALL, own_study, study

# It trains a study of its own.
pytestmark = pytest.mark.long
STUDY = Path("outputs/smoke_study")
FE2 = STUDY / "pairs/high/FE2"


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Measure a study of two seeds once."""
    folder = tmp_path_factory.mktemp("measured")
    study(*SMALL, "arms=[scratch,FE2]", folder=folder)
    layers(folder)
    return folder


@pytest.fixture
def folder(measured: Path, tmp_path: Path) -> Path:
    """Copy the measured study, to be changed."""
    return shutil.copytree(measured, tmp_path / "copy")


def layers(folder: Path, of: Path = STUDY) -> str:
    return ship_trl(str(of), LAYERS, folder=folder, verb="study layers").stdout


def refused(folder: Path, table: str = LAYERS) -> str:
    error = ship_trl(str(STUDY), table, folder=folder, verb="study layers", code=1).stderr
    assert error.startswith("ship_trl: ") and error.count("\n") == 1
    return error


def test_each_network_is_compared_with_its_source_and_scratch(measured: Path) -> None:
    rows = list(read_layers(measured / LAYERS).itertuples(index=False))
    assert {row.layer for row in rows} == {"conv1", "conv2", "conv3", "conv4", "shared"}
    assert {(row.arm, row.beside) for row in rows} == {
        *(("FE2", beside) for beside in ("source", "scratch")),
        *(("scratch", beside) for beside in ("source", "other seed", "untrained")),
    }
    assert len(rows) == len({row[:5] for row in rows}) and {row.pair for row in rows} == {"high"}
    copied = [row.cka for row in rows if (row.arm, row.beside) == ("FE2", "source")][:2]
    assert copied == pytest.approx([1.0, 1.0])
    assert all(row.cka < 0.999 for row in rows if row.beside in ("scratch", "other seed"))
    # The first seed has no other, so that a seed is compared with the same one whenever it is added.
    assert {row.seed for row in rows if row.beside == "other seed"} == {1}


def test_missing_seeds_are_added(folder: Path) -> None:
    lines = (folder / LAYERS).read_text().splitlines(keepends=True)
    (folder / LAYERS).write_text("".join(line for line in lines if not line.startswith("1,")))
    said = layers(folder)
    assert (folder / LAYERS).read_text() == "".join(lines)
    assert "seed 1: " in said and "seed 0: " not in said


def test_a_case_of_ones_own_needs_no_bundled_network(tmp_path: Path) -> None:
    own_study(tmp_path)
    study("harbour.yaml", f"overrides=[{','.join(SMOKE[1:])}]", "controls=false", folder=tmp_path)
    layers(tmp_path, Path("outputs/harbour"))
    table = read_layers(tmp_path / LAYERS)
    assert set(table["pair"]) == {"harbour"} and set(table["arm"]) == {"scratch", "FT3"}
    copied = table.query("arm == 'FT3' and beside == 'source' and layer in ('conv1', 'conv2')")
    assert len(copied) and (copied["cka"] > 0.3).all() and table["cka"].between(0.0, 1.0).all()


def test_an_untrusted_study_runs_no_code(folder: Path) -> None:
    (folder / LAYERS).unlink()
    (folder / "evil.py").write_text(f"open({str(folder / 'ran')!r}, 'w')\n")
    path = folder / FE2 / "seed=0/result.json"
    values = json.loads(path.read_text())
    path.write_text(json.dumps(values | {"source_network": f"{folder / 'evil.py'}:run"}))
    assert "folder: " in refused(folder)
    assert not (folder / "ran").exists()


def test_the_report_draws_the_table_beside_the_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place, picture = folder / STUDY, folder / STUDY / "report/layers.png"
    report([str(place)])
    assert not picture.exists()
    shutil.copy(folder / LAYERS, place / LAYERS)
    report([str(place)])
    drawn = picture.read_bytes()
    assert len(drawn) > 5_000 and capsys.readouterr().err == ""
