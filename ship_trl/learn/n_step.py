"""Double DQN with n-step targets: a value then travels n steps back in an update."""

from __future__ import annotations

from ship_trl.learn.algorithm import Setup
from ship_trl.learn.double_dqn import DoubleDQN


def build(setup: Setup) -> DoubleDQN:
    """Make double DQN with targets of `setup.options["steps"]` rewards."""
    return DoubleDQN(setup, n=setup.options["steps"])
