"""Every verb answers `--help` at once, in a process of its own, without torch and without a screen."""

import subprocess
import sys
from pathlib import Path

import pytest

from ship_trl.cli.help import VERBS
from tests.command import environment

HEAVY = {"torch", "pygame", "wandb", "matplotlib.pyplot", "pandas"}


@pytest.mark.parametrize("verb", VERBS)
def test_help_imports_nothing_heavy(verb: str, tmp_path: Path) -> None:
    line = [sys.executable, "-X", "importtime", "-m", "ship_trl", verb, "--help"]
    done = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path, env=environment(), check=True)
    assert f"python -m ship_trl {verb}" in done.stdout
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert not imported & HEAVY and not list(tmp_path.iterdir())
