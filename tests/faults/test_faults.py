"""A few fixed faults of every kind; `python -m tests.faults` makes more, at random."""

import itertools
import random
from pathlib import Path

import pytest

from tests import forked
from tests.faults import disk, files, inputs, judge, kills, samples, together
from tests.faults.__main__ import KINDS, find
from tests.faults.changes import die_at
from tests.faults.trial import Trial


def passed(*trials: Trial) -> None:
    assert [f"{trial.what}: {trial.problem}" for trial in trials if trial.problem] == []


def test_a_run_killed_between_two_steps_resumes(tmp_path: Path) -> None:
    folder = samples.new_folder(tmp_path)
    for step in (2, 9, 16):
        assert forked.run(*samples.ALONE, folder=folder, before=die_at(step)).code == -9
    assert kills.finish(samples.ALONE, folder) == ""


def test_two_equal_commands_train_once(tmp_path: Path) -> None:
    passed(together.trial("the same run", 0.0, None, samples.new_folder(tmp_path)))


@pytest.mark.parametrize("fault", [disk.full_at(0), disk.full_at(9), disk.small_files(disk.MIN_SIZE)])
def test_a_full_disk_is_reported_and_loses_nothing(fault: object, tmp_path: Path) -> None:
    passed(disk.trial("run", "full", fault, tmp_path / "run"))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["a stopped run", "case base", "results", "report of tables"])
def test_a_command_names_damaged_files(name: str, tmp_path: Path) -> None:
    passed(files.trial(name, random.Random(0), tmp_path / "0"))


@pytest.mark.parametrize("kind", inputs.KINDS)
def test_an_input_is_used_or_refused_in_one_line(kind: str) -> None:
    counts = inputs.try_inputs(kind, inputs.EXAMPLES[kind])
    assert counts[False] and (counts[True] or kind == "configurations")


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_more_faults_of_every_kind(kind: str, tmp_path: Path) -> None:
    passed(*itertools.islice(find(kind)(random.Random(1), tmp_path / "trials"), 5))


@pytest.mark.parametrize("line", ["", "no key", "seed:", "seed: a\nb", "\x1b[31mseed: red", "banana: no"])
def test_a_useless_error_message_is_found(line: str) -> None:
    with pytest.raises(AssertionError):
        judge.check_line(line)
