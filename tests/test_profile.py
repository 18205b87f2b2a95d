"""The profile that a suite asks for."""

import pytest

from ship_trl.__main__ import add_profile


@pytest.mark.parametrize(
    ("words", "added"),
    [
        (["target=traffic", "method=scratch"], ["profile=traffic"]),
        (["target=traffic", "profile=smoke"], []),
        (["target=4"], []),
        (["target=paper"], []),
        (["target=4,traffic", "-m"], []),
        (["+pair=high"], []),
    ],
)
def test_a_suite_may_ask_for_a_profile(words: list[str], added: list[str]) -> None:
    assert add_profile(words) == [*words, *added]
