"""Compute greedy returns before training, for many random draws of the layers that are not copied.

One draw tells little: an untrained network often repeats one action, and may reach the goal by chance.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Sequence

import torch
from torch import Generator
from torchrl.envs import EnvBase

from ship_trl.learn.backend import Draw
from ship_trl.learn.network import Dense, DuelingNetwork


def jumpstart(
    env: EnvBase,
    draw: Draw,
    network: DuelingNetwork,
    kept: Collection[str],
    draws: int,
    generator: Generator,
) -> list[float]:
    """Compute the greedy returns of `draws` networks, which copy the layers `kept` of `network`.

    Their other layers are drawn anew; `network` stays as it is. The batch size of `env` limits how many
    episodes run side by side. `draw` maps states to pixels, and `generator` is on the CPU.
    """
    redrawn = copy.deepcopy(network).cpu()
    networks = [copy.deepcopy(network) for _ in range(min(draws, env.batch_size[0]))]
    for each in networks:
        each.backend = Dense()
    returns: list[float] = []
    while len(returns) < draws:
        count = min(len(networks), draws - len(returns))
        for each in networks[:count]:
            redrawn.reset(generator, kept)
            each.load_state_dict(redrawn.state_dict())
        returns += run_episodes(env, draw, networks[:count])
    return returns


@torch.no_grad()
def run_episodes(env: EnvBase, draw: Draw, networks: Sequence[DuelingNetwork]) -> list[float]:
    """Run one greedy episode of each network, in the first rows of the batch, and return their returns."""
    step = env.reset()
    totals = torch.zeros(len(networks), dtype=torch.float64, device=env.device)
    running = list(range(len(networks)))
    while running:
        action = torch.zeros(env.batch_size, dtype=torch.int64, device=env.device)
        # All rows: on a GPU each number of rows would be captured anew.
        seen = draw(step["state"])
        for ship in running:
            action[ship] = networks[ship](seen[ship : ship + 1])[0].argmax()
        stepped, step = env.step_and_maybe_reset(step.set("action", action))
        after = stepped["next"]
        totals[running] += after["reward"][running, 0]
        ended = after["done"].squeeze(-1).tolist()
        running = [ship for ship in running if not ended[ship]]
    return [float(total) for total in totals]
