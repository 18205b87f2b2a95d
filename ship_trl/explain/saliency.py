"""Which parts of the picture the greedy action depends on: gradient, occlusion, and erased things.

All use the advantage of the greedy action over the mean of all actions. The value of the state is the same
for every action, so it changes no choice.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.state import select_ships, target_ships

# Side of the occluding square, in pixels; a target ship is 7 pixels long.
PATCH = 7


@dataclass(frozen=True)
class Erased:
    """Pictures without one thing: `pixels` uint8 [N, C, 84, 84], `mask` bool [N, 84, 84] where it was."""

    thing: str
    pixels: Tensor
    mask: Tensor

    @property
    def visible(self) -> Tensor:
        """Pictures that showed it, bool [N]."""
        return self.mask.flatten(1).any(1)


def erase_things(env: ShipEnv, states: Tensor) -> list[Erased]:
    """Erase the line to the goal, each target ship, and all ships from the pictures of states [N, S]."""
    pixels, background = env.rasteriser(states), env.rasteriser.background
    ships = list(range(target_ships(states).shape[-2]))

    def draw_ships(shown: list[int]) -> Tensor:
        return env.rasteriser(select_ships(states, shown))

    def differ(one: Tensor, other: Tensor) -> Tensor:
        return (one != other).any(1)

    without_ships = draw_ships([])
    # Ships are drawn over the line: their pixels stay.
    line = differ(without_ships, background) & ~differ(pixels, without_ships)
    found = [Erased("the line to the goal", torch.where(line[:, None], background, pixels), line)]
    for k in ships:
        without = draw_ships(ships[:k] + ships[k + 1 :])
        found.append(Erased(f"ship {k + 1}", without, differ(pixels, without)))
    if len(ships) > 1:
        found.append(Erased("all ships", without_ships, differ(pixels, without_ships)))
    return found


@torch.no_grad()
def greedy_actions(network: DuelingNetwork, pixels: Tensor) -> Tensor:
    """Choose the actions of the highest Q-values: uint8 [N, C, 84, 84] to int64 [N]."""
    return network(pixels).argmax(-1)


def advantage(network: DuelingNetwork, pixels: Tensor, action: Tensor) -> Tensor:
    """Compute the advantage of actions [N] over the mean of all: pixels [N, C, 84, 84] to [N]."""
    q = network.dense_q_values(pixels)
    return q.gather(1, action[:, None])[:, 0] - q.mean(1)


def gradient(network: DuelingNetwork, pixels: Tensor) -> Tensor:
    """Compute the size of the gradient of the greedy action's advantage (Simonyan et al. 2014).

    It is for pixels from 0 to 1 and summed over channels: float [N, 84, 84].
    """
    variable = pixels.float().requires_grad_(True)
    total = advantage(network, variable, greedy_actions(network, pixels)).sum()
    (slope,) = torch.autograd.grad(total, variable)
    return 255.0 * slope.abs().sum(1)


@torch.no_grad()
def occlusion(network: DuelingNetwork, picture: Tensor, background: Tensor) -> Tensor:
    """Compute the drop of the greedy action's advantage when a square is hidden (Zeiler and Fergus 2014).

    The square around each pixel of a picture, uint8 [C, 84, 84], shows the background, so that it adds no
    edges. The drop is in units of Q, float [84, 84], and negative where the advantage rises.
    """
    side, half = picture.shape[-1], PATCH // 2
    hidden = picture.repeat(side * side, 1, 1, 1)
    for place in range(side * side):
        row, column = divmod(place, side)
        rows = slice(max(0, row - half), row + half + 1)
        columns = slice(max(0, column - half), column + half + 1)
        hidden[place, :, rows, columns] = background[:, rows, columns]
    changed = (hidden != picture).flatten(1).any(1)
    drop = torch.zeros(side * side)
    if bool(changed.any()):
        action = greedy_actions(network, picture[None])
        whole = advantage(network, picture[None], action)
        pixels = hidden[changed]
        drop[changed] = whole - advantage(network, pixels, action.expand(len(pixels)))
    return drop.reshape(side, side)
