"""What cannot be trained in lockstep is refused in one line."""

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.run.lockstep import start_network
from ship_trl.run.plan import make_run
from tests.config.test_config import composed


def test_a_run_with_a_mask_is_refused() -> None:
    run = make_run(composed("target=4", "method=scratch", "observation=vector", "mask=rules"))
    with pytest.raises(ConfigError, match=r"^mask: must be null for runs in lockstep, got rules$"):
        start_network(run)
