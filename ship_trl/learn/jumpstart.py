"""Compute greedy returns before training, for many random draws of the layers that are not copied.

One draw tells little: an untrained network often repeats one action, and may reach the goal by chance.
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

# Maps the observation of one ship [1, ...] to its action [1].
Decide = Callable[[Tensor], Tensor]


def jumpstart(
    env: EnvBase,
    draw: Draw,
    network: DuelingNetwork,
    copied: int,
    draws: int,
    generator: Generator,
) -> list[float]:
    """Compute the greedy returns of `draws` networks, which copy the first `copied` conv layers of `network`.

    Their other layers are drawn anew; `network` stays as it is. The batch size of `env` limits how many
    episodes run side by side. `draw` maps states to pixels, and `generator` is on the CPU.
    """
    kept, redrawn = network.conv_names[:copied], copy.deepcopy(network).cpu()
    networks = [copy.deepcopy(network) for _ in range(min(draws, env.batch_size[0]))]
    encode: Callable[[Tensor], Tensor] = draw
    decide: list[Decide]
    if env.device is not None and env.device.type == "cpu" and supports_incremental(network.geometry):
        inferences = [CachedInference(each, draw.background, copied) for each in networks]
        decide = [inference.actions for inference in inferences]
        if copied >= network.linear_from:
            # All networks have the same copied layers: encode the pictures of all ships in one batch.
            encode, decide = (
                lambda state: inferences[0].encode(draw(state)),
                [one.actions_from_features for one in inferences],
            )
    else:
        decide = [lambda pixels, each=each: each(pixels).argmax(-1) for each in networks]  # type: ignore[misc]
    returns: list[float] = []
    while len(returns) < draws:
        count = min(len(networks), draws - len(returns))
        for each in networks[:count]:
            redrawn.reset(generator, kept)
            each.load_state_dict(redrawn.state_dict())
        returns += run_episodes(env, encode, decide[:count])
    return returns


@torch.no_grad()
def run_episodes(env: EnvBase, encode: Callable[[Tensor], Tensor], decide: Sequence[Decide]) -> list[float]:
    """Run one greedy episode of each policy, in the first rows of the batch, and return their returns."""
    step = env.reset()
    totals = torch.zeros(len(decide), dtype=torch.float64, device=env.device)
    running = list(range(len(decide)))
    while running:
        action = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)
        for ship, observation in zip(running, encode(step["state"][running]).split(1), strict=True):
            action[ship] = decide[ship](observation)[0]
        stepped, step = env.step_and_maybe_reset(step.set("action", action))
        after = stepped["next"]
        totals[running] += after["reward"][running, 0]
        ended = after["done"].squeeze(-1).tolist()
        running = [ship for ship in running if not ended[ship]]
    return [float(total) for total in totals]
