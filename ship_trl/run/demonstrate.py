"""Preload the replay with demonstrations before training."""

from __future__ import annotations

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.learn.replay import StateReplay
from ship_trl.run.run import Run
from ship_trl.sim.env import ShipEnv

# Allowed difference of returns, because processors round differently.
RETURN_TOLERANCE = 0.01


def preload_replay(run: Run, env: ShipEnv, replay: StateReplay) -> None:
    """Step through a run's demonstrations and store the steps; a full replay overwrites the oldest ones.

    Raises:
        ConfigError: a demonstration does not reach the return in its file.
    """
    folder = run.config.demonstrations
    for number, demonstration in enumerate(run.demonstrations, 1):
        current, total, done = env.reset(), 0.0, False
        for action in demonstration.actions:
            chosen = torch.full(env.batch_size, action, device=env.device)
            stepped, current = env.step_and_maybe_reset(current.set("action", chosen))
            # All environments of the batch do the same.
            replay.extend(stepped[:1])
            total += float(stepped["next", "reward"][0])
            done = bool(stepped["next", "done"][0])
            if done:
                break
        if not done or abs(total - demonstration.episode_return) > RETURN_TOLERANCE:
            raise ConfigError(
                f"demonstrations: number {number} of case {demonstration.case} in {folder} "
                f"says a return of {demonstration.episode_return:.2f} and reaches one of {total:.2f}"
            )
