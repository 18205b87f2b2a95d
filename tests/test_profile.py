"""The profile that a suite asks for."""

import pytest

from ship_trl.__main__ import add_profile
from ship_trl.config.errors import ConfigError


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("target=traffic method=scratch", "target=traffic profile=traffic method=scratch"),
        # The last word may belong to a flag.
        ("target=traffic --multirun", "target=traffic profile=traffic --multirun"),
        ("source=traffic target=imazu", "source=traffic profile=traffic target=imazu"),
        ("source=4 target=traffic -m", "source=4 target=traffic profile=traffic -m"),
        ("target=traffic,imazu profile=smoke", "target=traffic,imazu profile=smoke"),
        *((words, words) for words in ("target=4", "target=paper,4 -m", "+pair=high")),
    ],
)
def test_a_suite_may_ask_for_a_profile(words: str, wanted: str) -> None:
    assert " ".join(add_profile(words.split())) == wanted


def test_suites_of_a_grid_have_one_profile() -> None:
    with pytest.raises(ConfigError, match="of target=traffic,imazu have different ones; give profile=NAME"):
        add_profile(["-m", "target=traffic,imazu"])
