"""The network that sees numbers: the same interface as that of pixels, with fully connected layers."""

from dataclasses import replace

import pytest
import torch
from torch import Generator, Tensor, nn

from ship_trl.config.arm import Arm
from ship_trl.config.network import load_network
from ship_trl.config.types import Precision
from ship_trl.fast.worlds import make_env
from ship_trl.learn.double_dqn import build
from ship_trl.learn.network import DuelingNetwork, VectorNetwork, make_network
from ship_trl.learn.rollout import rollout
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.vector import VectorObservation
from ship_trl.transfer.methods import make_method
from tests.learn.worlds import fast_setup, schedule

CONFIG = load_network("vector")


PRECISIONS = {Precision.fp32: torch.float32, Precision.bf16: torch.bfloat16}


def network(seed: int = 0) -> DuelingNetwork:
    return make_network(CONFIG, 7, Generator().manual_seed(seed))


def numbers(*shape: int) -> Tensor:
    return torch.randn(*shape, CONFIG.inputs, generator=Generator().manual_seed(1))


def test_layers_of_ships_their_sums_and_maxima_carry_value_and_advantage() -> None:
    net = network()
    assert isinstance(net, VectorNetwork)
    assert net.layer_names == ("linear1", "linear2", "linear3", "shared")
    shapes = [tuple(layer.weight.shape) for layer in (*net.layers, net.value, net.advantage)]
    assert shapes == [(128, 25), (128, 128), (256, 262), (256, 256), (1, 256), (7, 256)]
    seen = numbers(5)
    own, ships = seen[:, :6], seen[:, 6:].view(5, 8, 19)
    ships[..., -1] = torch.tensor([1.0, 1.0, *[0.0] * 6])
    one, two, three, four = net.layers
    alone = [two(one(torch.cat((own, ships[:, k]), 1)).relu()).relu() for k in range(2)]
    pooled = torch.cat((own, alone[0] + alone[1], torch.maximum(*alone)), 1)
    features = four(three(pooled).relu()).relu()
    advantage = net.advantage(features)
    wanted = net.value(features) + advantage - advantage.mean(-1, keepdim=True)
    torch.testing.assert_close(net(seen), wanted)
    torch.testing.assert_close(net(seen.reshape(5, 1, -1)), wanted[:, None])
    activations = net.activations(seen)
    assert tuple(activations) == net.layer_names
    torch.testing.assert_close(activations["linear2"][:, 0], alone[0])
    torch.testing.assert_close(activations["shared"], features)


def test_without_layers_of_ships_all_layers_see_all_numbers() -> None:
    net = make_network(replace(CONFIG, linear=[9, 8], per_ship=0), 7, Generator().manual_seed(0))
    body = nn.Sequential(*(part for layer in net.layers for part in (layer, nn.ReLU())))
    torch.testing.assert_close(net.encode(numbers(4)), body(numbers(4)))
    torch.testing.assert_close(net(numbers(4)), net.q_values(body(numbers(4))))


@pytest.mark.parametrize("arm", ["FE1", "FT2", "FE3", "FTW"])
def test_layers_are_copied_and_frozen_from_the_input(arm: str) -> None:
    net, source, fresh = network(1), network(2), network(1)
    method = make_method(Arm.parse(arm))
    method.copy(net, source.state_dict())
    net.freeze(method.frozen_layers(0.0))
    copied = (*net.layer_names, "value", "advantage")[: 6 if arm == "FTW" else int(arm[2])]
    for name, parameter in net.named_parameters():
        layer = name.split(".")[0]
        origin = source if layer in copied else fresh
        assert torch.equal(parameter, origin.get_parameter(name)), name
        assert parameter.requires_grad != (arm.startswith("FE") and layer in copied), name


@pytest.mark.parametrize("precision", [Precision.fp32, Precision.bf16])
def test_it_learns_from_stored_states_and_leaves_frozen_layers(precision: Precision) -> None:
    world = load_world()
    observe = VectorObservation.of(CONFIG, world)
    net, exploration, replay = network(), *(Generator().manual_seed(k) for k in range(2))
    learn = schedule(warmup_steps=40, precision=precision)
    algorithm = build(fast_setup(net, observe, 7, learn, exploration, replay, make_method(Arm.parse("FE2"))))
    env = make_env(load_case("4", world), world, 4)
    before, step, losses = {k: v.clone() for k, v in net.state_dict().items()}, env.reset(), []
    for _ in range(20):
        stepped, step = env.step_and_maybe_reset(algorithm.act(step, 0))
        algorithm.observe(stepped)
        losses += algorithm.update()
    assert len(losses) == 10 and algorithm.dtype is PRECISIONS[precision]
    stored = algorithm.replay.sample(16)
    assert stored["vector"].shape == stored["next", "vector"].shape == (16, CONFIG.inputs)
    assert torch.equal(stored["vector"], observe(stored["state"]))
    for key, value in net.state_dict().items():
        assert torch.equal(value, before[key]) == key.startswith(("linear1", "linear2")), key
    assert rollout(make_env(env.case, world), algorithm.greedy)[0].q_values is not None
