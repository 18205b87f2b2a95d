"""The wheel, built from the sdist, runs from an empty folder without the checkout."""

import configparser
import os
import subprocess
import sys
from pathlib import Path

import pytest

import ship_trl
from tests.command import ROOT, files

HIGH = ("+pair=high", "method=finetune", "layers=3")
pytestmark = pytest.mark.long  # it installs


def python(*arguments: str | Path, cwd: Path, path: Path | None = None) -> str:
    """Run Python in a new process, which must succeed; return its standard output."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment |= {"OMP_NUM_THREADS": "1"} | ({"PYTHONPATH": str(path)} if path else {})
    line = [sys.executable, *map(str, arguments)]
    done = subprocess.run(line, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{' '.join(line)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def without_caches(folder: Path) -> dict[str, bytes]:
    """Read every file below a folder, except compiled ones."""
    return {name: data for name, data in files(folder).items() if "__pycache__" not in name}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with only the installed wheel."""
    built, place = tmp_path_factory.mktemp("built"), tmp_path_factory.mktemp("installed")
    python("-m", "hatchling", "build", "-t", "sdist", "-d", built, cwd=ROOT)
    pip = ("-m", "pip", "--quiet", "--disable-pip-version-check")
    alone = ("--no-deps", "--no-index")
    (sdist,) = built.glob("*.tar.gz")
    python(*pip, "wheel", *alone, "--no-build-isolation", "-w", built, sdist, cwd=built)
    (wheel,) = built.glob("*.whl")
    python(*pip, "install", *alone, "--target", place, wheel, cwd=built)
    return place


def test_wheel_holds_the_package_and_its_conf(installed: Path) -> None:
    package = without_caches(ROOT / "ship_trl")
    conf = {f"conf/{name}": content for name, content in files(ROOT / "conf").items()}
    assert without_caches(installed / "ship_trl") == package | conf
    assert {path.name for path in installed.iterdir()} == {
        "bin",
        "ship_trl",
        f"ship_trl-{ship_trl.__version__}.dist-info",
    }


def test_console_script_is_the_module(installed: Path) -> None:
    points = configparser.ConfigParser()
    points.read(installed / f"ship_trl-{ship_trl.__version__}.dist-info" / "entry_points.txt")
    assert dict(points["console_scripts"]) == {"ship-trl": "ship_trl.__main__:main"}


def test_wheel_runs_the_main_line(installed: Path, tmp_path: Path) -> None:
    python("-m", "ship_trl", *HIGH, "profile=smoke", cwd=tmp_path, path=installed)
    assert {path.name for path in tmp_path.iterdir()} == {"outputs"}
    folder = tmp_path / "outputs" / "smoke" / "high" / "FT3" / "seed=0"
    assert {"result.json", "curve.csv", "policy.safetensors"} <= {path.name for path in folder.iterdir()}
