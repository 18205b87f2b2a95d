"""The real command of a study, at smoke size."""

import os
import subprocess
import sys
from pathlib import Path

from tests.test_cli import ROOT, files

SMALL = ("profile=smoke", "pairs=[high]", "arms=[scratch,FTW]", "reuse=false", "controls=false", "retries=1")
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "COLUMNS": "120"}


def study(*overrides: str, folder: Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, "-m", "ship_trl.study", *overrides],
        cwd=folder,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done


def learned(folder: Path) -> dict[str, bytes]:
    """What was learned: curves and weights of all runs."""
    found = files(folder / "outputs/smoke_study")
    return {name: data for name, data in found.items() if name.endswith(("curve.csv", ".safetensors"))}
