"""The compiled loops behind the interfaces of `Transition` and `Rasteriser`."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from ship_trl.sim import scene
from ship_trl.sim.fast import draw_kernels, step_kernel
from ship_trl.sim.fast.step_kernel import Array
from ship_trl.sim.reward import ROUNDING, pay, reward_constants
from ship_trl.sim.transition import Outcome, Transition


def numbers(*values: float) -> Array:
    """Constants of a kernel, float32."""
    return np.asarray(values, dtype=np.float32)


class CompiledStep:
    """`Transition` on a CPU: states float32 [N, 4] and actions int64 [N] to an `Outcome`."""

    def __init__(self, reference: Transition) -> None:
        world = reference.world
        self._constants = (
            reference.actions.numpy(),
            reference.goal.numpy(),
            reference.ship_start.numpy(),
            reference.ship_velocity.numpy(),
            numbers(world.dt, world.safe_distance, world.goal_distance + ROUNDING, world.max_steps),
        )
        self._actions = self._constants[0]
        self._prices = tuple(numbers(*reward_constants(world.reward)))

    def into(
        self, state: Array, action: Array, after: Array, reward: Array, flags: Array, apart: Array
    ) -> None:
        """One action of each ship, by `step_kernel.step` and `reward.pay`, to the last four arrays."""
        sight = np.empty((2, len(action)))
        step_kernel.step(state, action, *self._constants, after, sight, flags, apart)
        pay(action, self._actions, self._prices, sight, flags, apart, reward)

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """One action of each ship."""
        count = state.shape[0]
        after, floats = torch.empty(count, 4, device="cpu"), torch.empty(2, count, device="cpu")
        flags = torch.empty(3, count, dtype=torch.bool, device="cpu")
        reward, apart = floats.unbind(0)
        before = state.contiguous().numpy(), action.contiguous().numpy()
        self.into(*before, after.numpy(), reward.numpy(), flags.numpy(), apart.numpy())
        goal, collision, truncated = flags.unbind(0)
        return Outcome(after, reward, goal, collision, truncated, apart)


class CompiledDrawing:
    """`Rasteriser.reference` on a CPU: states float32 [N, 4] to uint8 [N, C, 84 * 84].

    Args:
        world: the case's world.
        course: headings of the target ships, [K].
        outline: corners of a target ship in pixels, counter-clockwise, [E, 2].
        line_ink: colour of the line to the goal, [C].
        ship_ink: colour of the target ships, [C].
        background: what stays where it is, float [C, 84 * 84].
    """

    def __init__(
        self,
        world: Transition,
        course: Tensor,
        outline: Tensor,
        line_ink: Tensor,
        ship_ink: Tensor,
        background: Tensor,
    ) -> None:
        corners = outline.tolist()
        edges = []
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            length = math.hypot(bx - ax, by - ay)
            x, y = (by - ay) / length, (ax - bx) / length
            edges.append(numbers(x, y, x * ax + y * ay))
        self._shape = background.shape
        self._constants = (
            world.goal.numpy(),
            world.ship_start.numpy(),
            world.ship_velocity.numpy(),
            course.numpy(),
            np.stack(edges),
            numbers(world.world.dt, scene.PIXELS_PER_METRE, 0.5 + scene.LINE_WIDTH / 2),
            scene.patch_size(),
            scene.SIZE,
            line_ink.numpy(),
            ship_ink.numpy(),
            background.numpy(),
            (background + 0.5).to(torch.uint8).numpy(),
        )

    def into(self, state: Array, pictures: Array) -> None:
        """Draw each state into uint8 [N, C, 84 * 84]."""
        draw_kernels.draw(state, *self._constants, pictures)

    def __call__(self, state: Tensor) -> Tensor:
        """Draw each state."""
        pictures = torch.empty(state.shape[0], *self._shape, dtype=torch.uint8, device="cpu")
        self.into(state.detach().float().contiguous().numpy(), pictures.numpy())
        return pictures
