"""An episode to show: its numbers, what the network sees in it, and on which pixels its Q-values depend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from torch import Tensor

from ship_trl.learn.network import DuelingNetwork
from ship_trl.policies.entry import Entry, rollout_entry
from ship_trl.policies.named import network_of
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.state import first_case
from ship_trl.view.telemetry import Telemetry, measure_episode

# Pixels by which the gradient is blurred: single pixels show the stride of the first layer.
BLUR = 1.5
# Letters of a title.
MAX_TITLE = 44


@dataclass(frozen=True, eq=False)
class EpisodeView:
    """An episode, finished or not, and its title."""

    title: str
    telemetry: Telemetry
    rasteriser: Rasteriser
    network: DuelingNetwork | None = None

    def _pixels(self, step: int) -> Tensor:
        state = torch.from_numpy(self.telemetry.states[step]).float()
        return self.rasteriser(state.to(self.rasteriser.device))

    def see(self, step: int) -> NDArray[np.uint8]:
        """Draw the scene at a step as a network sees pixels: uint8 [C, 84, 84]."""
        return self._pixels(step).cpu().numpy()

    @property
    def sees_numbers(self) -> bool:
        """Whether the network sees numbers in place of the picture."""
        return self.network is not None and bool(self.network.config.linear)

    def salience(self, step: int) -> NDArray[np.float32] | None:
        """Return the `saliency` at a step, or None without a network that sees pixels."""
        if self.network is None or self.sees_numbers:
            return None
        return saliency(self.network, self._pixels(step))


def view_entry(entry: Entry, seed: int, episode: int = 1) -> EpisodeView:
    """Roll out an entry; from 2 on, the title states the number of the episode.

    Raises:
        ConfigError: the policy cannot be loaded.
    """
    env, policy, episodes = rollout_entry(entry, 1, seed)
    title = entry.label
    while len(title) > MAX_TITLE and "/" in title:
        # The end of a path says more than its first folders.
        title = title.split("/", 1)[1]
    if episode > 1:
        title += f", episode {episode}"
    telemetry = measure_episode(first_case(entry.suite, episodes[0].states[0]), entry.world, episodes[0])
    return EpisodeView(title, telemetry, env.rasteriser, network_of(policy))


def saliency(network: DuelingNetwork, pixels: Tensor) -> NDArray[np.float32]:
    """Compute how strongly the highest Q-value depends on each pixel: uint8 [C, 84, 84] to float32 [84, 84].

    This is the absolute gradient, summed over channels, blurred, and scaled to a maximum of 1.
    """
    with torch.enable_grad():
        # Convolve whole pictures: the incremental conv layers have no gradient for pixels.
        picture = pixels[None].float().requires_grad_()
        q = network.dense_q_values(picture)
        (gradient,) = torch.autograd.grad(q.max(), picture)
    blurred: NDArray[np.float32] = gaussian_filter(gradient.abs().sum((0, 1)).cpu().numpy(), BLUR)
    highest = float(blurred.max())
    return blurred / highest if highest > 0 else blurred
