"""Demonstrations at the start of a training: sailed again, and put into the replay."""

from __future__ import annotations

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.learn.replay import StateReplay
from ship_trl.run.run import Run
from ship_trl.sim.env import ShipEnv

# Of a raw return: another processor rounds differently.
ROUNDING = 0.01


def show_demonstrations(run: Run, env: ShipEnv, replay: StateReplay) -> None:
    """Put the steps of a run's demonstrations into the replay, as many as it holds.

    Raises:
        ConfigError: one does not end as it says.
    """
    folder = run.config.demonstrations
    for number, demonstration in enumerate(run.demonstrations, 1):
        current, total, done = env.reset(), 0.0, False
        for action in demonstration.actions:
            chosen = torch.full(env.batch_size, action, device=env.device)
            stepped, current = env.step_and_maybe_reset(current.set("action", chosen))
            # All ships of the batch sail the same.
            replay.extend(stepped[:1])
            total += float(stepped["next", "reward"][0])
            done = bool(stepped["next", "done"][0])
            if done:
                break
        if not done or abs(total - demonstration.episode_return) > ROUNDING:
            raise ConfigError(
                f"demonstrations: number {number} of case {demonstration.case} in {folder} "
                f"says a return of {demonstration.episode_return:.2f} and sails to one of {total:.2f}"
            )
