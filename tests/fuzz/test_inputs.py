"""Any input runs with finite numbers, or is refused in one line that names its key (the short form)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzz import commands
from tests.fuzz.case_files import GOOD, TRICKS
from tests.fuzz.judge import FaultError, check_line, leaves_nothing
from tests.fuzz.kinds import KINDS, case_file

# A file is read in a millisecond, a configuration composed and sailed in fifty.
SLOW, QUICK = 25, 60


@pytest.mark.parametrize("name", KINDS)
def test_what_is_given_runs_or_is_refused_in_one_line(name: str) -> None:
    tally: Counter[bool] = Counter()
    slow = name in list(KINDS)[:8]

    @settings(max_examples=SLOW if slow else QUICK, suppress_health_check=list(HealthCheck))
    @given(KINDS[name].inputs)
    def attempt(given_input: Any) -> None:
        tally[KINDS[name].attempt(given_input)] += 1

    attempt()
    # Neither of the two is all that there is, but of these kinds hardly any can run.
    assert tally[False] and (tally[True] or name in ("files that are no case", "configurations"))


def test_files_that_try_what_a_reader_of_yaml_may_do_wrong() -> None:
    found = {text: case_file(text.encode("utf-8", "surrogatepass")) for text in TRICKS}
    assert 5 < sum(found.values()) < len(found) / 3
    assert found[GOOD.replace("\n", "\r\n")] and found["\ufeff" + GOOD]


@pytest.mark.parametrize("command", commands.SHORT, ids=lambda command: str(command)[:60])
def test_the_command_refuses_in_one_line_and_leaves_nothing(
    command: commands.Command, tmp_path: Path
) -> None:
    commands.prepare(tmp_path)
    commands.attempt(command, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize(
    "command", commands.LONG[len(commands.SHORT) :], ids=lambda command: str(command)[:60]
)
def test_further_commands_refuse_in_one_line(command: commands.Command, tmp_path: Path) -> None:
    commands.prepare(tmp_path)
    commands.attempt(command, tmp_path)


@pytest.mark.parametrize(
    "line",
    ["", "no key", "seed:", "seed: two\nlines", "\x1b[31mseed: red", "banana: no", "seed: " + "a" * 3000],
)
def test_a_line_that_helps_nobody_is_a_fault(line: str) -> None:
    with pytest.raises(FaultError):
        check_line(line, "run")


def test_a_file_that_is_left_is_a_fault(tmp_path: Path) -> None:
    with pytest.raises(FaultError, match="left"), leaves_nothing(tmp_path):
        (tmp_path / "left").touch()
