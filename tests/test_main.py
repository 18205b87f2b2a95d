"""The commands as a whole: what they must not take from their surroundings."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import environment

# What a notebook sets for the commands of its cells.
BACKEND = "module://matplotlib_inline.backend_inline"
ENTRIES = {
    "ship_trl": "import sys; from ship_trl.__main__ import main; sys.argv[1:] = ['--help']; main()",
    "benchmarks": (
        "from contextlib import suppress\n"
        "from benchmarks.__main__ import main\n"
        "with suppress(SystemExit): main(['--help'])"
    ),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_the_backend_of_a_notebook_is_not_asked_for(entry: str, tmp_path: Path) -> None:
    words = [sys.executable, "-c", f"{ENTRIES[entry]}\nimport matplotlib"]
    surroundings = environment() | {"MPLBACKEND": BACKEND}
    done = subprocess.run(words, cwd=tmp_path, env=surroundings, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_a_library_leaves_the_users_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "svg")
    import ship_trl.view.charts

    assert ship_trl.view.charts and os.environ["MPLBACKEND"] == "svg"
