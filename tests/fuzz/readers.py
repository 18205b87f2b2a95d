"""What reads files that a run or a person left: it reads them, or its own error says in one line why not.

`python -m tests.fuzz.guided --seconds 600` gives them what a coverage-guided fuzzer makes up (Atheris, the
extra `fuzz`), and prints one table.
"""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from ship_trl.config.errors import ConfigError, one_line
from ship_trl.files.curve import COLUMNS, CURVE, CurveError, read_curve, split
from ship_trl.files.result import RESULT, ResultError, read_result
from ship_trl.policies.demonstrations import Demonstration, read_demonstration
from ship_trl.run import checkpoint
from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.plan.manifest import PLAN, begun_with, read_plan
from ship_trl.study.records.record import BrokenRunError, make_record
from tests.a_result import a_result
from tests.fuzz.case_files import GOOD
from tests.fuzz.judge import FaultError, listing
from tests.fuzz.trees import damaged
from tests.fuzz.values import mostly

ERRORS = (ConfigError, ResultError, CurveError, BrokenRunError, checkpoint.CheckpointError)
WORLD = load_world()


@dataclass(frozen=True)
class Reader:
    """One that reads the file `name` in a folder; `good` is one that it reads."""

    name: str
    good: bytes
    read: Callable[[Path], object]


def read_curve_and_count(folder: Path) -> object:
    """Read a curve, and make a record of it and a result that fits it or not."""
    rows = read_curve(folder)
    return make_record(a_result(episodes=len(split(rows)[0])), rows, folder)


def read_whole_result(folder: Path) -> object:
    """Read a result, and make a record of it and a curve that fits it or not."""
    result = read_result(folder)
    (folder / CURVE).write_bytes(curve())
    try:
        return make_record(result, read_curve(folder), folder), result.title, result.to_json()
    finally:
        (folder / CURVE).unlink()


def read_plans(folder: Path) -> object:
    """Read a study's plan as the report does, and as a copy of its tables."""
    return begun_with(folder), read_plan(folder / PLAN, "folder")


def curve() -> bytes:
    """Write a curve of four episodes and two evaluations."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerow([0, 0, *[""] * 6, -10.5, 60, "timeout", 80.5])
    for n in range(1, 5):
        writer.writerow([n, n * 40, 0.5, -200.25, 40, "collision", 30.5, 1.5, *[""] * 4])
    writer.writerow([4, 160, *[""] * 6, 83.9, 36, "goal", ""])
    return text.getvalue().encode()


def a_checkpoint() -> bytes:
    """Write a checkpoint of two small tensors."""
    import torch

    about = checkpoint.About("0123456789ab", "cpu", episode=3, episodes=20, steps=150, seconds=2.5)
    with tempfile.TemporaryDirectory() as folder:
        kept = checkpoint.Checkpoints(Path(folder))
        kept.write({"weight": torch.arange(6.0).view(2, 3), "curve": torch.tensor([7, 9])}, about)
        return next(kept.folder.glob("*.safetensors")).read_bytes()


JOB = {"name": "a", "stage": 0, "part": "pairs", "label": "high", "arm": "FT3", "seed": 0}
MANIFEST = {
    "settings": {"profile": "smoke", "first_seed": 0},
    "cases": {"1": "0123456789ab"},
    "judged": [0, 1],
    "rules": {"digest": "0123456789ab", "commit": "0123", "begun": "2024-01-01"},
    "jobs": [JOB],
}
SHOWN = Demonstration("4", "0123456789ab", "0123456789ab", [0, 3, 6], 80.5, "goal", "planner")
JSON = {"result": a_result(episodes=4).to_json(), "manifest": MANIFEST, "demonstration": asdict(SHOWN)}
READERS = {
    "case": Reader("mine.yaml", GOOD.encode(), lambda folder: load_case(str(folder / "mine.yaml"), WORLD)),
    "result": Reader(RESULT, json.dumps(JSON["result"]).encode(), read_whole_result),
    "manifest": Reader(PLAN, json.dumps(MANIFEST).encode(), read_plans),
    "curve": Reader(CURVE, curve(), read_curve_and_count),
    "demonstration": Reader(
        "4-001.json",
        json.dumps(JSON["demonstration"]).encode(),
        lambda folder: read_demonstration(folder / "4-001.json", len(WORLD.actions)),
    ),
    "checkpoint": Reader(
        "1.safetensors", a_checkpoint(), lambda folder: checkpoint.read(folder / "1.safetensors")
    ),
}


def give(reader: Reader, content: bytes, folder: Path) -> bool:
    """Let a reader read; returns whether it did, and False where its own error says in one line why not."""
    path = folder / reader.name
    path.write_bytes(content)
    before = listing(folder)
    try:
        reader.read(folder)
    except ERRORS as error:
        if not str(error).strip() or one_line(str(error)) != str(error):
            raise FaultError(f"not one line: {str(error)[:300]!r}") from None
        return False
    finally:
        if listing(folder) != before:
            raise FaultError("a reader left or changed files")
    return True


def contents(name: str) -> SearchStrategy[bytes]:
    """Files that a reader may meet: right, cut short, written over, or damaged in a value."""
    good = READERS[name].good
    cut = st.integers(0, len(good)).map(lambda n: good[:n])
    written_over = st.builds(
        lambda n, junk: good[:n] + junk + good[n + len(junk) :],
        st.integers(0, len(good)),
        st.binary(max_size=6),
    )
    choices = [cut, written_over, st.binary(max_size=100)]
    if name in JSON:
        values = damaged(JSON[name]).map(
            lambda tree: json.dumps(tree, default=str).encode("utf-8", "replace")
        )
        choices += [values, values]
    if name == "curve":
        cell = st.one_of(st.text(max_size=5), st.floats().map(repr), st.integers().map(str), st.just("1e400"))
        lines = [line.split(",") for line in good.decode().splitlines()]
        choices += [damaged_table(lines, cell)]
    return mostly(st.one_of(choices), st.just(good), 8)


@st.composite
def damaged_table(draw: st.DrawFn, lines: list[list[str]], cell: SearchStrategy[str]) -> bytes:
    """A table of comma-separated values with some cells replaced, and a line repeated or taken out."""
    table = [list(line) for line in lines]
    for _ in range(draw(st.integers(1, 4))):
        row = draw(st.sampled_from(table))
        row[draw(st.integers(0, len(row) - 1))] = draw(cell)
    if draw(st.booleans()):
        table.append(draw(st.sampled_from(table)))
    return ("\n".join(map(",".join, table)) + "\n").encode("utf-8", "replace")


def read(name: str, content: bytes) -> bool:
    """Give a reader one file, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return give(READERS[name], content, Path(folder))
