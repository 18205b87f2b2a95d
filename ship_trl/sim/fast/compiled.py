"""Compiled CPU versions of `Transition` and `Rasteriser`, behind the same interfaces."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ship_trl.sim import scene
from ship_trl.sim.fast import draw_kernels, step_kernel
from ship_trl.sim.fast.step_kernel import Array
from ship_trl.sim.geometry import polygon_edges
from ship_trl.sim.transition import Outcome, Transition


def float32_array(*values: float) -> Array:
    """Return the values as a float32 array."""
    return np.asarray(values, dtype=np.float32)


class CompiledStep:
    """`Transition` as a compiled loop on the CPU.

    `step(state, action)` maps float32 [N, S] and int64 [N] to an `Outcome`.
    """

    def __init__(self, reference: Transition) -> None:
        world = reference.world
        self._constants = reference.actions.numpy(), step_kernel.constants(world)
        self._actions = self._constants[0]
        self._amounts = tuple(float32_array(*reference.amounts))

    def step_into(
        self, state: Array, action: Array, after: Array, reward: Array, flags: Array, min_distance: Array
    ) -> None:
        """Take one action with each ship, and write the results into the last four arrays.

        Shapes: state, after float32 [N, S]; action int64 [N]; reward, min_distance float32 [N]; flags
        bool [3, N]: goal, collision, truncated.

        Raises:
            IndexError: action index out of range.
        """
        to_goal = np.empty((2, len(action)))
        step_kernel.step(state, action, *self._constants, after, to_goal, flags, min_distance)
        paid = action, self._actions, self._amounts, to_goal, flags, min_distance
        step_kernel.write_rewards(*paid, reward)

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """Take one action with each ship, as `step_into`; return the results as an `Outcome`."""
        count = state.shape[0]
        after, floats = torch.empty(state.shape, device="cpu"), torch.empty(2, count, device="cpu")
        flags = torch.empty(3, count, dtype=torch.bool, device="cpu")
        reward, min_distance = floats.unbind(0)
        inputs = state.contiguous().numpy(), action.contiguous().numpy()
        self.step_into(*inputs, after.numpy(), reward.numpy(), flags.numpy(), min_distance.numpy())
        goal, collision, truncated = flags.unbind(0)
        return Outcome(after, reward, goal, collision, truncated, min_distance)


class CompiledDrawing:
    """`Rasteriser.reference` as a compiled loop on the CPU.

    `drawing(state)` maps floats [N, S] to uint8 [N, C, 84 * 84].

    Shapes of the arguments: outline [E, 2], corners of a target ship in pixels, counter-clockwise; inks
    [3, C], colours of line, target ships and own ship; background [C, 84 * 84], the picture without line and
    target ships, in floats. `vector_scale` is the length in pixels of a speed vector of 1 m/s.
    """

    def __init__(
        self,
        outline: Tensor,
        inks: Tensor,
        background: Tensor,
        vector_scale: float,
    ) -> None:
        self._shape = background.shape
        bows = [length / 2 * scene.PIXELS_PER_METRE for length in (scene.OWN_LENGTH, scene.TARGET_LENGTH)]
        self._constants = (
            np.asarray(polygon_edges(outline), np.float32),
            float32_array(scene.PIXELS_PER_METRE, 0.5 + scene.LINE_WIDTH / 2, vector_scale, *bows),
            scene.patch_size(),
            scene.SIZE,
            inks.numpy(),
            background.numpy(),
            (background + 0.5).to(torch.uint8).numpy(),
        )

    def draw_into(self, state: Array, pictures: Array) -> None:
        """Draw states float32 [N, S] into `pictures`, uint8 [N, C, 84 * 84]; raise as `draw_kernels.draw`."""
        draw_kernels.draw(state, *self._constants, pictures)

    def __call__(self, state: Tensor) -> Tensor:
        """Draw states float [N, S]; return uint8 [N, C, 84 * 84]; raise as `draw_kernels.draw`."""
        pictures = torch.empty(state.shape[0], *self._shape, dtype=torch.uint8, device="cpu")
        self.draw_into(state.detach().float().contiguous().numpy(), pictures.numpy())
        return pictures
