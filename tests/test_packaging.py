"""The wheel, built from the sdist, runs from an empty folder without the checkout."""

import configparser
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import PathDistribution
from pathlib import Path

import pytest
import torch

import ship_trl
from tests.command import ROOT, files

HIGH = ("+pair=high", "method=finetune", "layers=3")
pytestmark = pytest.mark.long  # it installs


def python(
    *arguments: str | Path, cwd: Path, path: Path | None = None, program: str | Path = sys.executable
) -> str:
    """Run Python in a new process, which must succeed; return its standard output."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment |= {"OMP_NUM_THREADS": "1"} | ({"PYTHONPATH": str(path)} if path else {})
    line = [str(program), *map(str, arguments)]
    done = subprocess.run(line, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{' '.join(line)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def without_caches(folder: Path) -> dict[str, bytes]:
    """Read every file below a folder, except compiled ones."""
    return {name: data for name, data in files(folder).items() if "__pycache__" not in name}


PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")
ALONE = ("--no-deps", "--no-index")


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("built")
    python("-m", "hatchling", "build", "-t", "sdist", "-d", built, cwd=ROOT)
    (found,) = built.glob("*.tar.gz")
    return found


def build_wheel(source: Path, built: Path) -> Path:
    """Build the wheel of an sdist or of a folder."""
    built.mkdir(exist_ok=True)
    python(*PIP, "wheel", *ALONE, "--no-build-isolation", "-w", built, source, cwd=built)
    (wheel,) = built.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def installed(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with only the installed wheel."""
    built, place = tmp_path_factory.mktemp("built"), tmp_path_factory.mktemp("installed")
    python(*PIP, "install", *ALONE, "--target", place, build_wheel(sdist, built), cwd=built)
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


def test_the_description_is_the_readme_without_what_only_a_checkout_has(installed: Path) -> None:
    about = PathDistribution(installed / f"ship_trl-{ship_trl.__version__}.dist-info").metadata
    text = (
        (installed / f"ship_trl-{ship_trl.__version__}.dist-info" / "METADATA")
        .read_text()
        .partition("\n\n")[2]
    )
    assert about["Description-Content-Type"] == "text/markdown" and text.strip().startswith("# ship_trl\n")
    assert not re.search(r"\]\((?!https:)|<img|<source", text)


def test_wheel_runs_the_main_line(installed: Path, tmp_path: Path) -> None:
    python("-m", "ship_trl", *HIGH, "profile=smoke", cwd=tmp_path, path=installed)
    assert {path.name for path in tmp_path.iterdir()} == {"outputs"}
    folder = tmp_path / "outputs" / "smoke" / "high" / "FT3" / "seed=0"
    assert {"result.json", "curve.csv", "policy.safetensors"} <= {path.name for path in folder.iterdir()}


# Prints in how many of 256 scenes with ships that react compiled loops and torch differ after 40 steps.
COMPARE = """
import torch
from ship_trl.sim.cases import load_world
from ship_trl.fast.worlds import make_starts
from ship_trl.sim.cases import load_suite
from ship_trl.fast.worlds import make_step

world = load_world()
starts = make_starts(load_suite("traffic_reacting", world), world)
state = {fast: starts.sample(256, torch.Generator().manual_seed(0)) for fast in (False, True)}
step = {fast: make_step(world, fast=fast) for fast in state}
for _ in range(40):
    for fast in state:
        state[fast] = step[fast](state[fast], torch.full((256,), world.straight_action)).state
print(int(((state[True] - state[False]).abs() > 1).any(1).sum()))
"""


def test_an_upgrade_leaves_no_stale_loops(sdist: Path, tmp_path: Path) -> None:
    shutil.unpack_archive(sdist, tmp_path)
    (source,) = (path for path in tmp_path.iterdir() if path.is_dir())
    wheels = [build_wheel(source, tmp_path / "first")]
    sectors = source / "ship_trl" / "sim" / "encounter.py"
    text = sectors.read_text()
    assert text.count("math.radians(112.5)") == 1
    sectors.write_text(text.replace("math.radians(112.5)", "math.radians(60)"))
    wheels.append(build_wheel(source, tmp_path / "second"))
    python("-m", "venv", "--without-pip", "place", cwd=tmp_path)
    own = tmp_path / "place" / "bin" / "python"
    libraries = Path(torch.__file__).parents[1]
    for wheel in wheels:
        python(*PIP, "--python", own, "install", *ALONE, "--force-reinstall", wheel, cwd=tmp_path)
        assert python("-c", COMPARE, cwd=tmp_path, path=libraries, program=own) == "0\n"
