"""What in the picture moves the chosen action: gradient, occlusion, and things erased.

All of them ask for the advantage of the action that the network chooses, above the mean of all actions: the
value, which the dueling network adds to every action alike, moves no choice.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.cases import Case
from ship_trl.sim.render import Rasteriser

# Side in pixels of the square that occlusion covers; a target ship is 7 long.
PATCH = 7


@dataclass(frozen=True)
class Erased:
    """A thing of the picture: `pixels` uint8 [N, C, 84, 84] without it, `where` bool [N, 84, 84] it was."""

    thing: str
    pixels: Tensor
    where: Tensor

    @property
    def seen(self) -> Tensor:
        """Whether it is in the picture, bool [N]."""
        return self.where.flatten(1).any(1)


def things(case: Case, world: World, draw: Rasteriser, states: Tensor) -> list[Erased]:
    """Erase the line to the goal, each target ship, and all of them from the pictures of states [N, 4]."""
    whole = draw(states)
    colour = draw.channels == 3

    def drawn(keep: list[int]) -> Tensor:
        some = dataclasses.replace(case, target_ships=[case.target_ships[k] for k in keep])
        return Rasteriser(some, world, colour=colour)(states)

    def differ(one: Tensor, other: Tensor) -> Tensor:
        return (one != other).any(1)

    count = len(case.target_ships)
    line = drawn([])
    at_line = differ(line, draw.background)
    # A ship lies over the line: its pixels stay.
    only_line = at_line & ~differ(whole, line)
    found = [
        Erased("the line to the goal", torch.where(only_line[:, None], draw.background, whole), only_line)
    ]
    name = "the ship" if count == 1 else "ship {}"
    for k in range(count):
        without = drawn([j for j in range(count) if j != k])
        found.append(Erased(name.format(k + 1), without, differ(whole, without)))
    if count > 1:
        found.append(Erased("all ships", line, differ(whole, line)))
    return found


@torch.no_grad()
def choose(network: DuelingNetwork, pixels: Tensor) -> Tensor:
    """Choose the actions of the highest Q-values: uint8 [N, C, 84, 84] to int64 [N]."""
    return network(pixels).argmax(-1)


def advantage(network: DuelingNetwork, pixels: Tensor, action: Tensor) -> Tensor:
    """Compute the advantage of actions [N] above the mean of all: pixels [N, C, 84, 84] to [N]."""
    q = network.dueling(network.convolve(pixels))
    return q.gather(1, action[:, None])[:, 0] - q.mean(1)


@torch.no_grad()
def moved(network: DuelingNetwork, pixels: Tensor, other: Tensor) -> float:
    """Compute how far other pictures move the advantages, over how far they vary between the pictures.

    Both are root mean squares over pictures and actions: pixels and other [N, C, 84, 84].
    """
    before, after = (q - q.mean(1, keepdim=True) for q in (network(pixels), network(other)))
    return float(((after - before) ** 2).mean().sqrt() / before.std(0).square().mean().sqrt())


def gradient(network: DuelingNetwork, pixels: Tensor) -> Tensor:
    """Compute how strongly the chosen action's advantage answers to each pixel (Simonyan et al. 2014).

    Returns:
        The size of its derivative by the pixel, of full brightness, summed over colours: float [N, 84, 84].
    """
    asked = pixels.float().requires_grad_(True)
    total = advantage(network, asked, choose(network, pixels)).sum()
    (slope,) = torch.autograd.grad(total, asked)
    return 255.0 * slope.abs().sum(1)


@torch.no_grad()
def occlusion(network: DuelingNetwork, picture: Tensor, background: Tensor) -> Tensor:
    """Compute how far the chosen action's advantage falls when a square is hidden (Zeiler, Fergus 2014).

    The square shows what is there without line and ships, so that it has no edges of its own; where nothing
    is drawn nothing can change.

    Args:
        network: whose advantage.
        picture: uint8 [C, 84, 84].
        background: the picture without line and ships, of the same shape.

    Returns:
        The fall with the square around each pixel, in Q: float [84, 84]; below zero where it rises.
    """
    side, half = picture.shape[-1], PATCH // 2
    covered = picture.repeat(side * side, 1, 1, 1)
    for place in range(side * side):
        row, column = divmod(place, side)
        rows = slice(max(0, row - half), row + half + 1)
        columns = slice(max(0, column - half), column + half + 1)
        covered[place, :, rows, columns] = background[:, rows, columns]
    changed = (covered != picture).flatten(1).any(1)
    fall = torch.zeros(side * side)
    if bool(changed.any()):
        action = choose(network, picture[None])
        whole = advantage(network, picture[None], action)
        some = covered[changed]
        fall[changed] = whole - advantage(network, some, action.expand(len(some)))
    return fall.reshape(side, side)
