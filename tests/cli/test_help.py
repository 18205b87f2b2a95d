"""`--help`, of every verb too, answers at once, without torch and without a screen."""

import subprocess
import sys
from pathlib import Path

import pytest

from ship_trl.cli.help import VERBS
from tests.command import environment

HEAVY = {"torch", "pygame", "wandb", "matplotlib.pyplot", "pandas"}


@pytest.mark.parametrize("verb", ["", *VERBS])
def test_help_imports_nothing_heavy(verb: str, tmp_path: Path) -> None:
    words = [verb] if verb else []
    line = [sys.executable, "-X", "importtime", "-m", "ship_trl", *words, "--help"]
    done = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path, env=environment(), check=True)
    assert f"python -m ship_trl {verb}" in done.stdout
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert not imported & (HEAVY if verb else HEAVY | {"hydra", "omegaconf"}) and not list(tmp_path.iterdir())
    if not verb:
        told = {line.split()[0] for line in done.stdout.partition("Verbs: ")[2].splitlines()[1:]}
        assert told == set(VERBS)
        # Listed as their files stand in a folder.
        assert "scratch, feature_extraction, finetune, " in done.stdout
        assert "csv, tensorboard, wandb, " in done.stdout
