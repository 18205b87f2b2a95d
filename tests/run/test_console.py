"""What is printed: progress, what a process waits for, tables, the end of a run."""

import io
import re
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from filelock import FileLock
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.files.curve import Row
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run import console
from ship_trl.run.console import show
from ship_trl.run.history import to_row
from ship_trl.study import launch
from ship_trl.study.plan import plan_jobs, to_study
from tests.a_result import a_result
from tests.pasted import ODD, pasted, printed_commands
from tests.run.test_history import EPISODE
from tests.study.commands import SMALL


def rows(episodes: int, warmup: int = 12) -> Iterator[Row]:
    yield to_row(Evaluated(0, 0, [EPISODE]))
    for episode in range(1, episodes + 1):
        loss = None if episode <= warmup else 0.5
        yield to_row(Finished(episode, 30 * episode, 0.5, -1.25, 30, "goal", 50.0, loss))


def test_a_run_without_a_terminal_prints_lines(capsys: pytest.CaptureFixture[str]) -> None:
    assert len(list(console.progress("made", 100, rows(100)))) == 101
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "episode 1 of 100, return -1.2, greedy -3.5" and len(lines) == 21
    assert [" left" in line for line in lines[:6]] == [False] * 3 + [True] * 3, "not in the warm-up"
    assert re.fullmatch(r"episode 50 of 100, return -1\.2, greedy -3\.5, about \d+ s left", lines[10])


def test_a_waiting_process_names_what_it_waits_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(console, "SHORT_WAIT", 0.05)
    monkeypatch.setattr(console, "LONG_WAIT", 0.1)
    place = tmp_path / "run.lock"

    def wait() -> None:
        with console.hold(FileLock(place), "case 1, scratch, seed 0"):
            console.say("mine")

    waiting = threading.Thread(target=wait)
    with FileLock(place):
        waiting.start()
        time.sleep(0.5)
    waiting.join(10)
    *lines, last = capsys.readouterr().out.splitlines()
    assert last == "mine" and len(lines) >= 2
    told = f"waiting 0 s for another process that trains case 1, scratch, seed 0 ({place})"
    assert all(line == told for line in lines)
    with console.hold(FileLock(place), "nothing"):  # free again
        assert capsys.readouterr().out == ""


def test_a_study_without_a_terminal_prints_lines(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(launch, "LINE_SECONDS", 0.0)
    config = to_study([*SMALL, f"output={tmp_path}"])
    jobs = plan_jobs(config)
    with launch.show_progress(jobs, config, episodes=10) as watch:
        watch()
        place = jobs[0].folder(tmp_path)
        place.mkdir(parents=True)
        (place / "curve.csv").write_text("episode\n5,30\n")
        watch()
        watch()
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"0 of {len(jobs)} runs done, 0% of all"
    assert second.startswith(f"0 of {len(jobs)} runs done, {0.5 / len(jobs):.0%} of all")


def test_long_work_without_a_terminal_prints_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(console, "LINE_SECONDS", 0.0)
    with console.show_share("episodes") as show_done:
        for share in (0.0, 0.01, 0.5):
            show_done(share)
    printed = capsys.readouterr()
    lines = [line.split(",")[0] for line in printed.err.splitlines()]
    assert lines == ["episodes: 0% done", "episodes: 50% done"] and printed.out == ""
    with console.show_share("episodes") as show_done:
        show_done(0.0)
    assert len(capsys.readouterr().err.splitlines()) == 1


WORDS = st.text(st.characters(codec="ascii", categories=("L", "N", "P")), min_size=1, max_size=12)
CELLS = st.lists(WORDS, min_size=1, max_size=4).map(" ".join)


@given(st.lists(st.lists(CELLS, min_size=3, max_size=3), min_size=1, max_size=12), st.integers(10, 200))
def test_a_table_breaks_no_word(columns: list[list[str]], width: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", out := io.StringIO())
        for name, value in {"FORCE_COLOR": "1", "TERM": "xterm", "COLUMNS": str(width)}.items():
            patch.setenv(name, value)
        show([column[0] for column in columns], list(zip(*(column[1:] for column in columns), strict=True)))
        printed = Counter(re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue()).split())
    wanted = Counter(word for column in columns for cell in column for word in cell.split())
    assert not wanted - printed


def test_a_file_has_lines_of_any_length(capsys: pytest.CaptureFixture[str]) -> None:
    many = " ".join(f"{number}.25" for number in range(500))
    show(("run", "returns"), [("scratch", many)], title="Runs")
    assert f"scratch  {many}\n" in capsys.readouterr().out


@pytest.mark.parametrize("name", ODD)
def test_the_hint_to_watch_a_run_keeps_odd_folders(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = Path("outputs", name, "seed=0")
    console.show_result(a_result(), "title", folder, is_course_best=False)
    (line,) = printed_commands(capsys.readouterr().out)
    assert pasted(line) == ["watch", str(folder)]
