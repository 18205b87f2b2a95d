"""What cannot be trained in lockstep is refused in one line."""

import re

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.run.lockstep import start_network
from ship_trl.run.plan import make_run
from tests.config.test_config import composed


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("mask=rules", "mask: must be null for runs in lockstep, got rules"),
        ("learn.average=0.1", "learn.average: must be 0 for runs in lockstep, got 0.1"),
    ],
)
def test_a_run_with_what_only_a_loop_has_is_refused(word: str, told: str) -> None:
    run = make_run(composed("target=4", "method=scratch", "observation=vector", word))
    with pytest.raises(ConfigError, match=f"^{re.escape(told)}$"):
        start_network(run)
