"""Run the real command in a forked child or in a new process."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests import forked

ROOT = Path(__file__).parents[1]
# As long as real keys, because wandb rejects others. No file and no argument may contain them.
KEYS = {"WANDB_API_KEY": "a1b2c3d4e5" * 4, "RAY_AUTH_TOKEN": "f6e7d8c9" * 8}
# A run of three short episodes with a few small updates.
SMOKE = (
    *("profile=smoke", "learn.episodes=3", "learn.warmup_steps=60", "learn.batch_size=8"),
    "learn.jumpstart_draws=1",
)
# Keys of JSON files that hold a time, and a draft: a file that is written beside another one.
TIME_KEYS = {"seconds", "begun"}
DRAFT = re.compile(r"(^|/)\.(?!locks/|plans/)[^/]*(/[^/]*)?$")


def environment() -> dict[str, str]:
    """Return the environment of a command: this checkout, one thread, a terminal of fixed width."""
    found = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "COLUMNS": "120"}
    found.pop("HYDRA_FULL_ERROR", None)
    return found


def ship_trl(
    *arguments: str,
    folder: Path,
    verb: str = "",
    code: int = 0,
    first: str = "",
    new_process: bool = False,
    pictures: bool = False,
) -> subprocess.CompletedProcess[str]:
    """Run `python -m ship_trl VERB ARGUMENTS` in `folder`, and check its exit code.

    `verb` is empty for a run or a grid. `first` is Python code to run before it. A `new_process` takes five
    seconds more than a forked child, which draws `pictures` of runs and studies only if it is asked to.
    """
    words = [*verb.split(), *arguments]

    def before() -> None:
        from tests.pictures import draw, leave_out  # which import torch

        (draw if pictures else leave_out)()
        exec(first, {})

    if not new_process:
        ended = forked.run(*words, folder=folder, before=before, timeout=900.0)
        done = subprocess.CompletedProcess(words, ended.code or 0, ended.out, ended.err)
        assert ended.code == code, str(ended)
        return done
    program = ["-m", "ship_trl"]
    if first:
        then = (
            "import runpy, sys; sys.argv[0] = 'ship_trl'; runpy.run_module('ship_trl', run_name='__main__')"
        )
        program = ["-c", f"{first}\n{then}"]
    done = subprocess.run(
        [sys.executable, *program, *words],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done


def refused(capsys: pytest.CaptureFixture[str], main: Callable[[list[str]], None], *words: str) -> str:
    """Run a command that must exit with code 1 and one line; return the line."""
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    error = capsys.readouterr().err
    assert ended.value.code == 1 and error.count("\n") == 1 and error.startswith("ship_trl: ")
    return error


def of_study(verb: str) -> Callable[[list[str]], None]:
    """Make a function that runs `study VERB` with words, in this process."""

    def run(words: list[str]) -> None:
        from ship_trl.cli import study  # which takes seconds

        study.main([verb, *words])

    return run


report, ask, keep = map(of_study, ("report", "ask", "keep"))


def files(folder: Path) -> dict[str, bytes]:
    """Read every file below a folder; of last checkpoints, what tells no time."""
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {str(path.relative_to(folder)): read_timeless(path) for path in paths}


def read_timeless(path: Path) -> bytes:
    """Read a file; of a run's last checkpoint leave out the time of training, and the digest of all."""
    data = path.read_bytes()
    if path.name != "checkpoint.safetensors":
        return data
    end = 8 + int.from_bytes(data[:8], "little")
    header: Any = json.loads(data[8:end])
    about = json.loads(header["__metadata__"]["ship_trl"])
    header["__metadata__"] = {key: value for key, value in about.items() if key not in ("seconds", "digest")}
    return json.dumps(header, sort_keys=True).encode() + data[end:]


def contents(folder: Path) -> dict[str, bytes]:
    """Read all files below a folder but locks and drafts outside the folders of runs, without times."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if not path.is_file() or ".locks" in path.parts or (DRAFT.search(name) and "seed=" not in name):
            continue
        data = read_timeless(path).replace(str(folder.resolve()).encode(), b"FOLDER")
        if path.suffix == ".json":
            values: Any = json.loads(data)
            data = json.dumps({k: v for k, v in values.items() if k not in TIME_KEYS}).encode()
        found[name] = data
    return found
