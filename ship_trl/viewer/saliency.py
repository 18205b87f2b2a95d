"""On which pixels the Q-value of the chosen action depends: its gradient with respect to the picture."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from torch import Tensor

from ship_trl.learn.network import DuelingNetwork

# Pixels by which the gradient is smeared: single ones are noise of the first layer's stride.
SMEAR = 1.5


def saliency(network: DuelingNetwork, pixels: Tensor) -> NDArray[np.float32]:
    """Compute how strongly the highest Q-value depends on each pixel, 0 to 1.

    Args:
        network: in which the Q-value is computed, in float32.
        pixels: uint8 [C, 84, 84].

    Returns:
        float32 [84, 84]: size of the gradient, summed over channels, smoothed, its greatest 1.
    """
    with torch.enable_grad():
        # Whole pictures: the quick ways of computing know no gradient of a pixel.
        picture = pixels[None].float().requires_grad_()
        q = network.dueling(network.convolve(picture))
        (slope,) = torch.autograd.grad(q.max(), picture)
    size: NDArray[np.float32] = gaussian_filter(slope.abs().sum((0, 1)).cpu().numpy(), SMEAR)
    most = float(size.max())
    return size / most if most > 0 else size
