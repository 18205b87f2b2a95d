"""An episode as it is shown: its numbers, what the network sees in it, and where the network looks."""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from torch import Tensor

from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.render import Rasteriser
from ship_trl.view.telemetry import Telemetry

# Pixels by which the gradient is blurred: single pixels show the stride of the first layer.
BLUR = 1.5


class EpisodeView:
    """An episode, whole or so far, under a title; pictures are computed when they are asked for.

    `see(step)` is what the network sees, uint8 [C, 84, 84]; `salience(step)` is where it looks, float
    [84, 84], None without a network.
    """

    def __init__(
        self, title: str, telemetry: Telemetry, rasteriser: Rasteriser, network: DuelingNetwork | None = None
    ) -> None:
        self.title, self.telemetry, self.rasteriser = title, telemetry, rasteriser
        states = torch.from_numpy(telemetry.states).float().to(rasteriser.device)

        @cache
        def see(step: int) -> NDArray[np.uint8]:
            return rasteriser(states[step]).cpu().numpy()

        @cache
        def salience(step: int) -> NDArray[np.float32] | None:
            return None if network is None else saliency(network, rasteriser(states[step]))

        self.see, self.salience = see, salience


def saliency(network: DuelingNetwork, pixels: Tensor) -> NDArray[np.float32]:
    """Compute how strongly the highest Q-value depends on each pixel: uint8 [C, 84, 84] to float32 [84, 84].

    It is the size of the gradient, summed over channels, blurred, and scaled to a maximum of 1.
    """
    with torch.enable_grad():
        # Whole pictures: the incremental conv layers have no gradient by pixels.
        picture = pixels[None].float().requires_grad_()
        q = network.dueling(network.convolve(picture))
        (slope,) = torch.autograd.grad(q.max(), picture)
    size: NDArray[np.float32] = gaussian_filter(slope.abs().sum((0, 1)).cpu().numpy(), BLUR)
    most = float(size.max())
    return size / most if most > 0 else size
