"""The commands as a whole: what they must not take from their surroundings."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.command import environment
from tests.study.synthetic import write_run

# What a notebook sets for the commands of its cells.
BACKEND = "module://matplotlib_inline.backend_inline"
BENCHMARKS = (
    "from benchmarks.__main__ import main\ntry: main(['--help'])\nexcept SystemExit: import matplotlib"
)
ENTRIES = {
    "ship_trl": ("-m", "ship_trl", "results", ".", "--picture", "drawn.png"),
    "benchmarks": ("-c", BENCHMARKS),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_the_backend_of_a_notebook_is_not_asked_for(entry: str, tmp_path: Path) -> None:
    write_run(tmp_path, np.full(50, 0.5))
    words, surroundings = [sys.executable, *ENTRIES[entry]], environment() | {"MPLBACKEND": BACKEND}
    done = subprocess.run(words, cwd=tmp_path, env=surroundings, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert entry == "benchmarks" or (tmp_path / "drawn.png").exists()


def test_a_library_leaves_the_users_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "svg")
    import ship_trl.view.charts

    assert ship_trl.view.charts and os.environ["MPLBACKEND"] == "svg"
