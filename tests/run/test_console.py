"""What a run prints at its end."""

from pathlib import Path

import pytest

from ship_trl.run import console
from tests.a_result import a_result
from tests.pasted import ODD, pasted, printed_commands


@pytest.mark.parametrize("name", ODD)
def test_the_hint_to_watch_a_run_keeps_odd_folders(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = Path("outputs", name, "seed=0")
    console.show_result(a_result(), "title", folder, is_course_best=False)
    (line,) = printed_commands(capsys.readouterr().out)
    assert pasted(line) == ["watch", str(folder)]
