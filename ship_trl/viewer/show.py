"""What the dashboard shows: an episode, whole or so far, with what the network sees in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray

from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.render import Rasteriser
from ship_trl.viewer.saliency import saliency
from ship_trl.viewer.telemetry import Telemetry

Picture = NDArray[np.uint8]
Heat = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Show:
    """An episode to be shown; the dashboard draws anew what belongs to it when it is given another one.

    `see(step)` is what the network sees, uint8 [C, 84, 84]; `salience(step)` where it looks, float [84, 84],
    None where there is no network. `episode` is a word on which one it is.
    """

    title: str
    telemetry: Telemetry
    see: Callable[[int], Picture]
    salience: Callable[[int], Heat | None]
    episode: str = ""


def make_show(
    title: str,
    telemetry: Telemetry,
    rasteriser: Rasteriser,
    network: DuelingNetwork | None = None,
    episode: str = "",
) -> Show:
    """Make what is shown of an episode; pictures and saliency are computed when they are asked for."""
    states = torch.from_numpy(telemetry.states).float().to(rasteriser.device)

    @cache
    def see(step: int) -> Picture:
        with torch.no_grad():
            return rasteriser(states[step]).cpu().numpy()

    @cache
    def salience(step: int) -> Heat | None:
        return None if network is None else saliency(network, rasteriser(states[step]))

    return Show(title, telemetry, see, salience, episode)
