"""Compiled loops come from a cache only if it holds what is compiled today, and can be read."""

import importlib.util
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ship_trl.fast import jit
from tests.test_layering import PACKAGE, imports

SOURCE = (
    "def double(row):\n    total = row[0]\n    for value in row:\n        total += value\n    return total\n"
)
ROWS = np.ones(3), np.ones(3, np.float32)


@pytest.fixture(autouse=True)
def forget_the_module(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "loops", sys)


def loop(folder: Path) -> Any:
    """Compile SOURCE as a file of `folder`, as a new process would do."""
    path = folder / "loops.py"
    path.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location("loops", path)
    assert spec is not None and spec.loader is not None
    module = sys.modules["loops"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return jit.compiled()(module.double)


def hits(folder: Path) -> int:
    """Call the loop with every type of row; return how many came from the cache."""
    found = loop(folder)
    assert [found(row) for row in ROWS] == [4, 4]
    assert [str(part[0].dtype) for part in found.signatures] == ["float64", "float32"]
    return sum(found.stats.cache_hits.values())


def cached(folder: Path) -> list[Path]:
    return sorted((folder / "__pycache__").rglob("*.nb?"))


def test_a_second_process_compiles_nothing(tmp_path: Path) -> None:
    assert (hits(tmp_path), hits(tmp_path)) == (0, 2)


def test_a_terminal_is_told_once_that_loops_are_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[int] = []
    for is_terminal in (False, True, True):
        jit.announce.cache_clear()
        monkeypatch.setattr(sys.stderr, "isatty", lambda shown=is_terminal: shown)
        (tmp_path / str(len(told) // 2)).mkdir(exist_ok=True)
        hits(tmp_path / str(len(told) // 2))
        told.append(capsys.readouterr().err.count("compiling loops"))
    # The second is compiled for the first one already, and the third is not.
    assert told == [0, 0, 1]


def test_the_key_covers_what_loops_may_inline() -> None:
    covered = {path for pattern in jit.INLINED for path in PACKAGE.glob(pattern)}
    names = {path: imports(path) for path in PACKAGE.rglob("*.py")}
    loops = PACKAGE / "fast/jit.py"
    numba = {name for path in names for name in names[path] if name.startswith("numba") and path != loops}
    assert numba == {"numba.float32", "numba.extending.register_jitable"}

    def modules(path: Path) -> set[Path]:
        parts = [name.split(".")[1:] for name in names[path] if name.startswith("ship_trl.")]
        places = {PACKAGE.joinpath(*part[:end]).with_suffix(".py") for part in parts for end in range(1, 9)}
        return places & names.keys()

    found = {path for path in names if loops in modules(path)}
    while new := {other for path in found for other in modules(path)} - found:
        found |= new
    assert len(found) > 20 and covered >= found


@pytest.mark.parametrize("name", ["sim/encounter.py", "fast/step.py", "config/bounds.py", "fast/jit.py"])
def test_another_text_is_another_key(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = shutil.copytree(PACKAGE, tmp_path / "ship_trl", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(jit, "PACKAGE", copy)
    assert jit.PREFIX + jit.digest() == jit.FOLDER
    text = (copy / name).read_text()
    (copy / name).write_text(text + "# another\n")
    assert jit.PREFIX + jit.digest() != jit.FOLDER
    (copy / name).write_text(text)
    (copy / "view" / "chart.py").write_text("")
    assert jit.PREFIX + jit.digest() == jit.FOLDER


def test_loops_of_another_text_are_not_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hits(tmp_path)
    monkeypatch.setattr(jit, "FOLDER", jit.PREFIX + "0" * 16)
    assert (hits(tmp_path), hits(tmp_path)) == (0, 2)


def cut(share: float) -> Callable[[Path], None]:
    return lambda path: os.truncate(path, int(share * path.stat().st_size))


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize(
    "harm",
    [cut(0), cut(0.99)],
    ids=["0", ".99"],
)
def test_what_cannot_be_read_is_compiled_again(
    harm: Callable[[Path], None], suffix: str, tmp_path: Path
) -> None:
    hits(tmp_path)
    for path in cached(tmp_path):
        if path.suffix == suffix:
            harm(path)
    assert hits(tmp_path) == 0
    assert hits(tmp_path) == 2


def test_a_loop_for_other_types_is_not_taken(tmp_path: Path) -> None:
    # Two processes that store two signatures at once may give both files one name.
    hits(tmp_path)
    first, second = (path for path in cached(tmp_path) if path.suffix == ".nbc")
    shutil.copy(first, second)
    assert (hits(tmp_path), hits(tmp_path)) == (1, 2)


def test_without_a_writable_folder_loops_are_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "/dev/null")
    (tmp_path / "__pycache__").write_text("")
    assert (hits(tmp_path), hits(tmp_path)) == (0, 0)
