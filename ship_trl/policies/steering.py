"""Steer a course by actions."""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.config.types import World

# Error of the course (rad) that is not steered against.
DEADBAND = 0.05


class Steering:
    """Chooses the action that brings own ship onto a course at a speed.

    An action that turns at a rate may leave an error of one such turn, so that two opposite actions in turn
    hold a course at the speed of turning: no action is both slow and straight. This rule is ours.
    """

    def __init__(self, world: World, device: torch.device | str = "cpu") -> None:
        actions = torch.tensor(world.actions, device=device)
        self.speed, self.turn = actions[:, 0], actions[:, 1] * world.dt
        self.allowed = self.turn.abs().clamp(min=DEADBAND)

    def __call__(self, error: Tensor, speed: Tensor) -> Tensor:
        """Return action indices, int64 [N].

        Args:
            error: wanted minus present heading (rad) [N].
            speed: wanted speed (m/s) [N].
        """
        left = (error[:, None] - self.turn).abs()
        excess = (left - self.allowed).clamp(min=0.0)
        slower = (self.speed - speed[:, None]).abs()
        # First the course, then the speed, then what is left of the error.
        return (1e4 * excess + 10.0 * slower + left).argmin(-1)
