"""A few faults of every kind, always the same ones; `python -m tests.faults` makes as many as one likes."""

import random
from pathlib import Path

import pytest

from tests.faults import clock, command, disk, files, kills, memory, mounted, readers, runs, together
from tests.faults.__main__ import KINDS, find
from tests.faults.runs import ALONE, a_folder
from tests.faults.trial import DRAFT, Trial, difference, state

mounts = pytest.mark.skipif(not mounted.possible(), reason="nothing can be mounted here")


def survives(*trials: Trial) -> None:
    assert [f"{trial.what}: {trial.lost}" for trial in trials if trial.lost] == []


def test_a_kill_between_any_two_steps_of_a_run_leaves_nothing(tmp_path: Path) -> None:
    folder = a_folder(tmp_path, 0)
    for step in (2, 9, 16):
        done = command.run(*ALONE, folder=folder, before=kills.die_at(step))
        assert done.code == -9, done
    survives(kills.conclude(None, ALONE, "ship_trl", folder, "killed", 3))


def test_two_that_want_one_run_train_it_once(tmp_path: Path) -> None:
    survives(together.two("the same run", 0.0, None, a_folder(tmp_path, 0)))


@pytest.mark.parametrize("future", [False, True])
def test_clocks_that_jump_change_nothing(future: bool, tmp_path: Path) -> None:
    jumps = [(0.0, -3600.0), (0.0, 7200.0), (0.5, 1e9)]
    survives(clock.one((*ALONE, clock.WAITING), jumps, future, a_folder(tmp_path, 0)))


def test_a_clock_that_nothing_asks_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock, "ASKING", set())
    assert "asked" in clock.one(ALONE, [(0.0, 1e9)], False, a_folder(tmp_path, 0)).lost


@mounts
def test_a_full_disk_is_said_and_loses_nothing(tmp_path: Path) -> None:
    survives(*(disk.full("keep", room, tmp_path / str(room)) for room in (0, 5000)))


@mounts
@pytest.mark.parametrize("how", ["mounted so", "of somebody else"])
def test_a_folder_that_cannot_be_written_is_said(how: str, tmp_path: Path) -> None:
    survives(disk.closed("keep", how, tmp_path / "there"))


@pytest.mark.parametrize("name", readers.READERS)
def test_damaged_files_are_refused_by_what_reads_them(name: str, tmp_path: Path) -> None:
    survives(readers.batch(name, 0, tmp_path / "damaged", 6))


@pytest.mark.parametrize("name", ["a stopped run", "results, all"])
def test_damaged_files_are_named_by_a_command(name: str, tmp_path: Path) -> None:
    survives(*(files.one(name, random.Random(k), tmp_path / str(k)) for k in range(2)))


def test_a_run_without_memory_can_be_given_again(tmp_path: Path) -> None:
    survives(memory.a_run(random.Random(1), a_folder(tmp_path, 0)))


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_faults_of_every_kind(kind: str, tmp_path: Path) -> None:
    trials = find(kind)(random.Random(1), tmp_path)
    survives(*(next(trials) for _ in range(4)))


def test_what_is_lost_is_seen() -> None:
    wanted, got = runs.wanted(ALONE), state(runs.undisturbed(ALONE)[0])
    assert difference(wanted, got) == ""
    name = next(name for name in got if name.endswith("curve.csv"))
    assert difference(wanted, got | {name: b""}) == f"{name} differs"
    assert difference(wanted, got | {".draft": b""}) == ".draft is too much"
    assert difference(wanted, {k: v for k, v in got.items() if k != name}) == f"{name} is missing"


def test_a_reader_that_fails_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(folder: Path) -> None:
        raise KeyError("unexpected")

    monkeypatch.setitem(readers.READERS, "case", (fail, readers.READERS["case"][1]))
    assert "KeyError" in readers.batch("case", 0, tmp_path / "damaged", 1).lost


def test_a_command_that_ends_badly_is_seen(tmp_path: Path) -> None:
    done = command.run("nonsense", folder=a_folder(tmp_path, 0))
    assert done.code == 1 and done.refused
    assert not command.Done(1, "", "Traceback (most recent call last):\n", 0.0).explained
    assert DRAFT.search("a/.result.12.json") and not DRAFT.search("a/.locks/result.lock")
