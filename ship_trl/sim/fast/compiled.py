"""Compiled CPU versions of `Transition` and `Rasteriser`, behind the same interfaces."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from ship_trl.sim import scene
from ship_trl.sim.fast import draw_kernels, step_kernel
from ship_trl.sim.fast.step_kernel import Array
from ship_trl.sim.reward import POSITION_TOLERANCE, reward_constants, write_rewards
from ship_trl.sim.transition import Outcome, Transition


def float32_array(*values: float) -> Array:
    """Return the values as a float32 array."""
    return np.asarray(values, dtype=np.float32)


class CompiledStep:
    """`Transition` as a compiled loop on the CPU.

    `step(state, action)` maps float32 [N, 4] and int64 [N] to an `Outcome`.

    Args:
        reference: the simulation step to compile, on the CPU.
    """

    def __init__(self, reference: Transition) -> None:
        world = reference.world
        self._constants = (
            reference.actions.numpy(),
            reference.goal.numpy(),
            reference.ship_start.numpy(),
            reference.ship_velocity.numpy(),
            float32_array(
                world.dt, world.safe_distance, world.goal_distance + POSITION_TOLERANCE, world.max_steps
            ),
        )
        self._actions = self._constants[0]
        self._reward_constants = tuple(float32_array(*reward_constants(world.reward)))

    def step_into(
        self, state: Array, action: Array, after: Array, reward: Array, flags: Array, min_distance: Array
    ) -> None:
        """Take one action with each ship, and write the results into the last four arrays.

        Shapes: state, after float32 [N, 4]; action int64 [N]; reward, min_distance float32 [N]; flags
        bool [3, N]: goal, collision, truncated.

        Raises:
            IndexError: action index out of range.
        """
        to_goal = np.empty((2, len(action)))
        step_kernel.step(state, action, *self._constants, after, to_goal, flags, min_distance)
        write_rewards(action, self._actions, self._reward_constants, to_goal, flags, min_distance, reward)

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """Take one action with each ship: states float32 [N, 4], action indices int64 [N].

        Raises:
            IndexError: action index out of range.
        """
        count = state.shape[0]
        after, floats = torch.empty(count, 4, device="cpu"), torch.empty(2, count, device="cpu")
        flags = torch.empty(3, count, dtype=torch.bool, device="cpu")
        reward, min_distance = floats.unbind(0)
        before = state.contiguous().numpy(), action.contiguous().numpy()
        self.step_into(*before, after.numpy(), reward.numpy(), flags.numpy(), min_distance.numpy())
        goal, collision, truncated = flags.unbind(0)
        return Outcome(after, reward, goal, collision, truncated, min_distance)


class CompiledDrawing:
    """`Rasteriser.reference` as a compiled loop on the CPU.

    `drawing(state)` maps floats [N, 4] to uint8 [N, C, 84 * 84].

    Args:
        transition: the case's simulation step, with goal and target ships.
        course: headings of the target ships in radians, [K].
        outline: corners of a target ship in pixels, counter-clockwise, [E, 2].
        line_ink: colour of the line to the goal, [C].
        ship_ink: colour of the target ships, [C].
        background: the picture without line and target ships, float [C, 84 * 84].
    """

    def __init__(
        self,
        transition: Transition,
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
            edges.append(float32_array(x, y, x * ax + y * ay))
        self._shape = background.shape
        self._constants = (
            transition.goal.numpy(),
            transition.ship_start.numpy(),
            transition.ship_velocity.numpy(),
            course.numpy(),
            np.stack(edges),
            float32_array(transition.world.dt, scene.PIXELS_PER_METRE, 0.5 + scene.LINE_WIDTH / 2),
            scene.patch_size(),
            scene.SIZE,
            line_ink.numpy(),
            ship_ink.numpy(),
            background.numpy(),
            (background + 0.5).to(torch.uint8).numpy(),
        )

    def draw_into(self, state: Array, pictures: Array) -> None:
        """Draw states float32 [N, 4] into `pictures`, uint8 [N, C, 84 * 84].

        Raises:
            ValueError: a state is not finite, or larger than `draw_kernels.MAX_STATE_SUM`.
        """
        draw_kernels.draw(state, *self._constants, pictures)

    def __call__(self, state: Tensor) -> Tensor:
        """Draw states float [N, 4]; return uint8 [N, C, 84 * 84].

        Raises:
            ValueError: a state is not finite, or larger than `draw_kernels.MAX_STATE_SUM`.
        """
        pictures = torch.empty(state.shape[0], *self._shape, dtype=torch.uint8, device="cpu")
        self.draw_into(state.detach().float().contiguous().numpy(), pictures.numpy())
        return pictures
