"""What a network scores before training, over many draws of the layers that are not copied.

One draw says little: before training a network often holds one action, and whether that leads to
the goal is luck.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

import torch
from torch import Generator, Tensor
from torchrl.envs import EnvBase

from ship_trl.config.network import supports_incremental
from ship_trl.learn.backend import Draw
from ship_trl.learn.fast.inference import CachedInference
from ship_trl.learn.network import DuelingNetwork

# One ship's observation [1, ...] to its action [1].
Decide = Callable[[Tensor], Tensor]


def jumpstart(
    env: EnvBase,
    draw: Draw,
    network: DuelingNetwork,
    copied: int,
    draws: int,
    generator: Generator,
) -> list[float]:
    """Greedy returns of `draws` networks that share the first layers of `network`, and draw the others.

    They sail side by side: a step of many ships costs little more than a step of one. `network` stays
    as it is, and so does every other stream.

    Args:
        env: the world, with a batch of as many ships as sail at once.
        draw: states to pixels.
        network: what training begins with.
        copied: how many conv layers, counted from the image, are shared.
        draws: how many.
        generator: of the draws, on the CPU.
    """
    shared, drawn = network.conv_names[:copied], copy.deepcopy(network).cpu()
    fleet = [copy.deepcopy(network) for _ in range(min(draws, env.batch_size[0]))]
    look: Callable[[Tensor], Tensor] = draw
    decide: list[Decide]
    if env.device is not None and env.device.type == "cpu" and supports_incremental(network.geometry):
        inferences = [CachedInference(each, draw.background, copied) for each in fleet]
        decide = [inference.actions for inference in inferences]
        if copied >= network.linear_from:
            # What so many layers make of the pictures is computed for all ships at once.
            look, decide = lambda state: inferences[0].encode(draw(state)), [g.actions_on for g in inferences]
    else:
        decide = [lambda pixels, each=each: each(pixels).argmax(-1) for each in fleet]  # type: ignore[misc]
    found: list[float] = []
    while len(found) < draws:
        count = min(len(fleet), draws - len(found))
        for each in fleet[:count]:
            drawn.reset(generator, shared)
            each.load_state_dict(drawn.state_dict())
        found += sail(env, look, decide[:count])
    return found


@torch.no_grad()
def sail(env: EnvBase, look: Callable[[Tensor], Tensor], decide: Sequence[Decide]) -> list[float]:
    """Sail one greedy episode of each decider, in the first rows of the batch, and give their returns."""
    step = env.reset()
    totals = torch.zeros(len(decide), dtype=torch.float64, device=env.device)
    going = list(range(len(decide)))
    while going:
        action = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)
        for ship, seen in zip(going, look(step["state"][going]).split(1), strict=True):
            action[ship] = decide[ship](seen)[0]
        stepped, step = env.step_and_maybe_reset(step.set("action", action))
        after = stepped["next"]
        totals[going] += after["reward"][going, 0]
        ended = after["done"].squeeze(-1).tolist()
        going = [ship for ship in going if not ended[ship]]
    return [float(total) for total in totals]
