"""`python -m ship_trl watch`: its arguments, and its message where there is no screen."""

from pathlib import Path

import pytest

from ship_trl.cli.watch import main
from ship_trl.policies.named import failures_first
from ship_trl.policies.registry import split_suites
from ship_trl.run.entries import find_entries
from tests.command import refused


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["keep_course", "random", "--compare", "target=2"], "keep_course random target=2 --compare"),
        (["my policy.py:act", "target=2"], "'my policy.py:act' target=2"),
        ([], "pretrained target=4"),
    ],
)
def test_without_a_screen_record_is_offered(
    words: list[str],
    offered: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    act = "def act(env, seed):\n    return lambda step: step.set('action', env.action_spec.zero())\n"
    (tmp_path / "my policy.py").write_text(act)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    said = refused(capsys, main, *words)
    assert said.startswith("ship_trl: no screen")
    assert f"python -m ship_trl record {offered} --output film.gif" in said
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {"my policy.py"}


def test_of_a_suite_the_failures_of_the_first_policy_come_first() -> None:
    entries = split_suites(find_entries(["keep_course", "best_known", "target=paper"], False))
    found = [(entry.policy, entry.suite.case.name) for entry in failures_first(entries)]
    assert [case for policy, case in found[:7]] == ["3", "4", "5", "6", "1", "2", "new"]
    assert {policy for policy, _ in found[:7]} == {"keep_course"}
    assert found[7:] == [("best_known", case) for case in ("1", "2", "3", "4", "5", "6", "new")]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("nobody target=2", "policy: no nobody; allowed"),
        ("random --compare target=2", "--compare: needs two policies, got random alone"),
        ("random target=2 --fast", "unrecognized arguments: --fast"),
    ],
)
def test_wrong_input_is_refused(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert said in refused(capsys, main, *words.split())
