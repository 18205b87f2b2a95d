"""The tables of every verb: at 80 and 120 characters, and in a pipe, every number can be read."""

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ship_trl.cli import cases, evaluate, metrics, results, study
from ship_trl.files.record import SourceReturns
from ship_trl.run import console
from tests.a_result import a_result
from tests.study.synthetic import write_run, write_study

SHOW = console.show
SOURCE = SourceReturns(90.0, 0.0, 0.0, -10.0, -100.0, 100.0)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two folders of runs with many seeds, a study, and a log."""
    folder = tmp_path_factory.mktemp("tables")
    for below in ("one", "two"):
        for seed in range(12):
            scores = np.full(50, 0.4 + 0.01 * seed)
            write_run(folder / below, scores, arm="scratch", seed=seed)
            write_run(folder / below, scores, arm="FT3", seed=seed, on_source=SOURCE)
    write_study(folder / "study", 5)
    lines = [f"{step},{step / 10 + seed},{seed}" for seed in range(3) for step in range(0, 1000, 50)]
    for arm in ("scratch", "FT3"):
        (folder / f"{arm}.csv").write_text("\n".join(["step,return,seed", *lines]))
    return folder


def finish(_: list[str]) -> None:
    """Print what a run prints at its end."""
    result = a_result(on_source=SOURCE)
    console.show_result(result, "case 1 -> case 2, FT3, seed 0", Path("outputs"), is_course_best=True)


VERBS: dict[str, tuple[Callable[[list[str]], None], str]] = {
    "one episode": (evaluate.main, "keep_course vo target=4,ship"),
    "one episode, all": (evaluate.main, "keep_course vo target=4 --all"),
    "many episodes": (evaluate.main, "keep_course target=imazu"),
    "several suites": (evaluate.main, "keep_course target=paper,paper_perturbed --episodes 7"),
    "rules": (evaluate.main, "keep_course target=imazu --rules"),
    "all": (evaluate.main, "keep_course target=paper --all --by class"),
    "results": (results.main, "one"),
    "results, all": (results.main, "one two --all --stability --transfer --test"),
    "metrics": (results.main, "scratch=scratch.csv FT3=FT3.csv"),
    "a case": (cases.main, "target=4 --picture case.png"),
    "cases": (cases.main, "target=paper,ship --picture cases.png"),
    "ask": (study.main, "ask study high:+FTW+above+scratch"),
    "a run": (finish, ""),
}


@pytest.mark.parametrize("name", VERBS)
def test_no_number_is_cut(
    name: str, runs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(runs)
    main, line = VERBS[name]
    monkeypatch.setattr(evaluate.Evaluated, "decision_time", 0.5)
    tables: list[tuple[tuple[Any, ...], dict[str, Any]]] = []

    def record(headings: Sequence[str], rows: Iterable[Sequence[str]], *more: Any, **options: Any) -> None:
        tables.append(((headings, list(rows), *more), options))

    for module in (study, cases, console, metrics, results):
        monkeypatch.setattr(module, "show", record)
    main([word.replace("+", " ") for word in line.split()])
    capsys.readouterr()
    assert tables
    for values, options in tables:
        shown = options.get("shown") or (values[5] if len(values) > 5 else values[0])
        kept = [k for k, heading in enumerate(values[0]) if heading in shown]
        cells = {row[k] for row in values[1] for k in kept if re.search(r"\d", row[k])}
        for width in ("80", "120", "a pipe"):
            for key, value in (("FORCE_COLOR", "1"), ("TERM", "dumb"), ("COLUMNS", width)):
                monkeypatch.setenv(key, value)
            if width == "a pipe":
                monkeypatch.delenv("FORCE_COLOR")
            SHOW(*values, **options)
            lines = capsys.readouterr().out.splitlines()
            parts = {part for line in lines for part in re.split(r"\s{2,}", line.strip())}
            # Lists of many seeds are wrapped between numbers.
            whole = {cell for cell in cells if width == "a pipe" or len(cell) <= int(width) // 2}
            assert whole <= parts, whole - parts
            assert {word for cell in cells for word in cell.split()} <= set(" ".join(lines).split())
            assert width == "a pipe" or max(map(len, lines)) <= int(width)


def test_five_columns_fit_eighty_characters(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for key, value in (("FORCE_COLOR", "1"), ("TERM", "dumb"), ("COLUMNS", "80")):
        monkeypatch.setenv(key, value)
    evaluate.main(["keep_course", "vo", "target=imazu"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].strip() == "imazu: 22 episodes" and max(map(len, lines)) <= 80
    rows = {line.split()[0]: re.split(r"\s{2,}", line.strip())[1:] for line in lines if "%" in line}
    assert rows["keep_course"] == ["0% (0 to 15)", "100%", "0%", "41 (35)"]
    assert rows["vo"][:3] == ["100% (85 to 100)", "0%", "0%"]
