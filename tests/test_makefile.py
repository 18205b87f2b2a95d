"""`make` takes a Python that fits, and says how to get one where there is none."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import ROOT

MAKE = shutil.which("make")
pytestmark = pytest.mark.skipif(MAKE is None, reason="the images have no make")


def give(place: Path, minor: int, missing: str = "nothing") -> None:
    """Write a command that is Python 3.MINOR, without a module; in a folder `bin` it is that of a venv."""
    place.parent.mkdir(parents=True, exist_ok=True)
    prefix = "'venv'" if place.parent.name == "bin" else "sys.base_prefix"
    before = f"import sys; sys.prefix, sys.version_info = {prefix}, (3, {minor}, 9)"
    before += f"; sys.modules['{missing}'] = None"
    place.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{before}; $2"\n')
    place.chmod(0o755)


def install(folder: Path, *words: str, code: int = 0) -> str:
    """Return what `make install` would do where the only commands are those of a folder."""
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHON", "MAKEFLAGS")}
    line = [str(MAKE), "-C", str(ROOT), "--dry-run", "install", "VENV=" + str(folder / "venv"), *words]
    done = subprocess.run(
        line, env=environment | {"PATH": str(folder)}, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


@pytest.mark.parametrize(
    ("pythons", "words", "taken"),
    [
        ({"python3": 13, "python3.12": 12}, [], "python3"),
        ({"python3": 14}, [], "python3"),
        ({"python3": 9, "python3.14": 14, "python3.11": 11}, [], "python3.14"),
        ({"python3": 15, "python3.11": 11}, [], "python3.11"),
        ({"python3": 13, "python3.12": 12}, ["PYTHON=python3.12"], "python3.12"),
    ],
)
def test_the_first_that_fits_makes_the_environment(
    pythons: dict[str, int], words: list[str], taken: str, tmp_path: Path
) -> None:
    for name, minor in pythons.items():
        give(tmp_path / name, minor)
    assert f"\n{taken} -m venv {tmp_path}/venv\n" in install(tmp_path, *words)


def test_one_without_what_venv_needs_is_passed_over(tmp_path: Path) -> None:
    """As on Debian and Ubuntu, whose python3 alone leaves half an environment behind."""
    give(tmp_path / "python3", 13, missing="ensurepip")
    give(tmp_path / "python3.12", 12)
    assert "\npython3.12 -m venv " in install(tmp_path)


@pytest.mark.parametrize("pythons", [{}, {"python3": 10}, {"python3": 15}])
def test_where_none_fits_a_line_says_how_to_get_one(pythons: dict[str, int], tmp_path: Path) -> None:
    for name, minor in pythons.items():
        give(tmp_path / name, minor)
    told = install(tmp_path, code=2)
    assert "needs Python 3.11 to 3.14" in told and "apt install python3-venv" in told
    assert f"uv venv --seed --python 3.13 {tmp_path}/venv" in told and "pip install" not in told


def test_an_environment_that_is_there_is_used(tmp_path: Path) -> None:
    """As one of `uv venv --seed --python 3.13 .venv`, where the system has no Python that fits."""
    give(tmp_path / "venv/bin/python", 13)
    told = install(tmp_path)
    assert "-m venv" not in told and f"{tmp_path}/venv/bin/python -m pip install " in told
    give(tmp_path / "venv/bin/python", 13, missing="pip")  # of `uv venv` without --seed
    assert "uv venv --seed" in install(tmp_path, code=2)
    give(tmp_path / "python3", 12)
    assert f"\npython3 -m venv {tmp_path}/venv\n" in install(tmp_path)
