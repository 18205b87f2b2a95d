"""On which pixels Q depends."""

import torch
from torch import Generator

from ship_trl.config.types import World
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.policies.entry import rollout_entry
from ship_trl.policies.named import network_of
from ship_trl.view.episode_view import saliency
from tests.view.episodes import entry


def network(channels: int = 1) -> DuelingNetwork:
    return DuelingNetwork(channels, 7, Generator().manual_seed(1))


def test_saliency_marks_pixels_that_change_q() -> None:
    made = network()
    pixels = torch.randint(0, 256, (1, 84, 84), generator=Generator().manual_seed(2), dtype=torch.uint8)
    heat = torch.from_numpy(saliency(made, pixels))
    assert heat.shape == (84, 84) and float(heat.max()) == 1.0 and float(heat.min()) >= 0
    with torch.no_grad():
        q = made(pixels[None])
        best = int(q.argmax())

        def change(block: torch.Tensor) -> float:
            moved = pixels.float()
            moved[0, block] += 1.0
            return abs(float(made.dueling(made.encode(moved[None]))[0, best] - q[0, best]))

        # Single pixels cancel; a bright patch has more effect than a dark one in the mean.
        order = heat.flatten().argsort()
        effects = []
        for pick in (order[:400], order[-400:]):
            one = []
            for place in pick[::8]:
                block = torch.zeros(84 * 84, dtype=torch.bool)
                block[place] = True
                one.append(change(block.view(84, 84)))
            effects.append(sum(one) / len(one))
    assert effects[1] > 2 * effects[0]


def test_a_network_without_weights_has_no_saliency() -> None:
    made = network(3)
    with torch.no_grad():
        made.layers[0].weight.zero_()
    assert not saliency(made, torch.full((3, 84, 84), 100, dtype=torch.uint8)).any()


def test_only_networks_have_saliency(world: World) -> None:
    made = network()
    assert network_of(greedy_policy(made, lambda state: state)) is made
    env, policy, _ = rollout_entry(entry())
    assert env.batch_size == (1,) and network_of(policy) is None
