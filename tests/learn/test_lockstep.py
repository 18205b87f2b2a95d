"""Agents in lockstep learn what they learn alone; stacked networks compute what each computes alone."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch
from tensordict import TensorDict
from torch import Generator, Tensor
from torch.func import stack_module_state

from ship_trl.config.network import ConvLayer, load_network
from ship_trl.config.types import BackendName, Learn, World
from ship_trl.fast.worlds import make_rasteriser, make_step
from ship_trl.learn.algorithm import learning_rate_at
from ship_trl.learn.double_dqn import DoubleDQN, build
from ship_trl.learn.lockstep import Lockstep, Windows, make_stacked_q
from ship_trl.learn.network import DuelingNetwork, VectorNetwork, make_network
from ship_trl.learn.q_learning import STEPS
from ship_trl.sim.cases import load_case
from ship_trl.sim.state import initial_state
from tests.learn.worlds import Freezing, fast_setup, schedule

PLACES, ACTIONS, INPUTS = 4, 2, 3
CONFIG = replace(load_network("vector"), linear=[16, 8, 8], per_ship=0)


def step(state: Tensor, action: Tensor) -> SimpleNamespace:
    """Walk a corridor, by 1 or by -1, from the state (place, time): the goal is at 4, a wall at -2."""
    place, time = state[:, 0] + 2.0 * action - 1.0, state[:, 1] + 1
    goal, collision = place >= PLACES, place <= -2
    truncated = (time >= 12) & ~goal & ~collision
    reward = -1.0 + 10.0 * goal - 5.0 * collision
    ends = {"goal": goal, "collision": collision, "truncated": truncated}
    return SimpleNamespace(state=torch.stack((place, time), 1), reward=reward, **ends)


def observe(state: Tensor) -> Tensor:
    place, time = state.unbind(-1)
    return torch.stack((place / PLACES, place.square() / 10, 0.0 * time + 1.0), -1)


def networks(count: int) -> list[DuelingNetwork]:
    return [VectorNetwork(INPUTS, ACTIONS, Generator().manual_seed(seed), CONFIG) for seed in range(count)]


def learn_config(**changes: object) -> Learn:
    values = {"num_envs": 4, "batch_size": 16, "update_every": 4, "warmup_steps": 64, "replay_size": 400}
    return schedule(**(values | {"lr": 1e-3, "tau": 0.05, "backend": BackendName.dense} | changes))


def lockstep(
    seeds: Sequence[int],
    frozen: Sequence[Sequence[str]] | None = None,
    n: int = 3,
    total: int = 4000,
    **changes: object,
) -> Lockstep:
    everyone = networks(max(seeds) + 1)
    streams = [[Generator().manual_seed(10 * seed + k) for seed in seeds] for k in (1, 2)]
    begin = torch.zeros(len(seeds), 2)
    chosen = [everyone[seed] for seed in seeds]
    return Lockstep(
        chosen, frozen or [()] * len(seeds), begin, step, observe, learn_config(**changes), n, total, *streams
    )


def test_an_agent_learns_with_others_what_it_learns_alone() -> None:
    together, alone = lockstep((0, 1, 2)), lockstep((1,))
    for one in (together, alone):
        one.train(600)
    assert together.updates == alone.updates > 100
    for name, value in alone.weights(0).items():
        torch.testing.assert_close(together.weights(1)[name], value, rtol=1e-4, atol=1e-5)
        assert not torch.allclose(together.weights(0)[name], value, atol=1e-3)


@pytest.mark.long
def test_agents_learn_to_reach_the_goal() -> None:
    many = lockstep((0, 1, 2), epsilon_fraction=0.5)
    many.train(3000)
    _, reached = many.evaluate(torch.zeros(3, 1, 2))
    assert reached.all()


def record_samples(many: Lockstep) -> list[tuple[Tensor, ...]]:
    """Return the list to which the batches of further updates are added."""
    drawn: list[tuple[Tensor, ...]] = []
    sample = many.sample

    def note() -> tuple[Tensor, ...]:
        drawn.append(sample())
        return drawn[-1]

    many.sample = note  # type: ignore[method-assign]
    return drawn


def check_updates(many: Lockstep, drawn: list[tuple[Tensor, ...]], alone: Sequence[DoubleDQN]) -> None:
    """Update each agent alone by the same batches, and compare the networks."""
    learn, (key,) = many.learn, {agent.online_network.observes for agent in alone}
    see = many.observe
    for number, (states, action, reward, following, terminated, steps) in enumerate(drawn):
        # An update is due every `update_every` steps, and takes the rate after all steps of its call.
        taken = learn.warmup_steps + (number + 1) * learn.update_every
        taken = -(-taken // learn.num_envs) * learn.num_envs
        for k, agent in enumerate(alone):
            agent.optimiser.set_lr(learning_rate_at(taken / many.total * learn.episodes, learn))
            reward_sum = reward[k] * learn.reward_scale
            after = {key: see(following[k]), "reward": reward_sum, "terminated": terminated[k]}
            batch = {key: see(states[k]), "action": action[k], STEPS: steps[k], "next": after}
            agent.learn_from(TensorDict(batch, batch_size=[learn.batch_size]))
    for k, agent in enumerate(alone):
        for name, value in agent.network.state_dict().items():
            torch.testing.assert_close(many.weights(k)[name], value, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("n", [1, 3])
def test_an_update_is_that_of_double_dqn(n: int) -> None:
    agents, frozen = (0, 1, 2), [(), ("linear1",), ()]
    many = lockstep(agents, frozen, n, lr_end=0.0, total=300)
    alone = []
    for network, names in zip(networks(3), frozen, strict=True):
        method = Freezing(len(names))
        alone.append(
            build(fast_setup(network, observe, ACTIONS, many.learn, Generator(), Generator(), method=method))
        )
    drawn = record_samples(many)
    many.train(200)
    assert len(drawn) == many.updates > 20
    check_updates(many, drawn, alone)


def test_networks_of_pixels_learn_in_lockstep_too(world: World) -> None:
    ships, case = make_rasteriser(world), initial_state(load_case("4", world), world)
    learn = learn_config(batch_size=8, warmup_steps=32, lr_end=0.0)
    made = [DuelingNetwork(1, 7, Generator().manual_seed(seed)) for seed in (0, 1)]
    streams = [[Generator().manual_seed(10 * seed + k) for seed in (0, 1)] for k in (1, 2)]
    many = Lockstep(made, [()] * 2, case.expand(2, -1), make_step(world), ships, learn, 1, 4000, *streams)
    alone = [build(fast_setup(network, ships, 7, learn, Generator(), Generator())) for network in made]
    drawn = record_samples(many)
    many.train(44)
    assert many.updates == len(drawn) == 3
    check_updates(many, drawn, alone)


def test_a_sample_sums_the_rewards_of_an_episode_and_no_more() -> None:
    many = lockstep((0, 1), epsilon_start=1.0, epsilon_end=1.0)
    # More than the replay holds, so that it has begun anew.
    many.train(600)
    gamma = many.learn.gamma
    seen = set()
    for _ in range(20):
        states, action, reward, following, terminated, length = (one[0] for one in many.sample())
        for row in range(len(states)):
            count, (place, time) = int(length[row]), states[row].tolist()
            after, last = following[row].tolist()
            assert last == time + count
            first = place + 2 * int(action[row]) - 1
            # Each step costs 1; the last may reach the goal, or hit the wall.
            bonus = 10 * (after >= PLACES) - 5 * (after <= -2)
            wanted = sum(-(gamma**k) for k in range(count)) + gamma ** (count - 1) * bonus
            assert float(reward[row]) == pytest.approx(wanted, abs=1e-5)
            assert bool(terminated[row]) == (after >= PLACES or after <= -2)
            assert count == 1 or -2 < first < PLACES
            seen.add((count, bool(terminated[row])))
    assert {1, 2, 3} <= {count for count, _ in seen} and {True, False} == {ended for _, ended in seen}


def inputs(network: str, generator: Generator) -> Tensor:
    """Return what the networks see, [3, 2, ...]."""
    if network == "vector":
        return torch.rand(3, 2, load_network(network).inputs, generator=generator)
    pixels = torch.randint(0, 256, (3, 2, 1, 84, 84), generator=generator)
    return pixels.to(torch.uint8)


@pytest.mark.parametrize("network", ["paper", "five", "vector"])
def test_each_network_has_its_own_q_values_and_gradients(network: str) -> None:
    config = load_network(network)
    alone = [make_network(config, 7, Generator().manual_seed(seed)) for seed in range(3)]
    stacked = {name: value.detach() for name, value in stack_module_state(list(alone))[0].items()}
    for value in stacked.values():
        value.requires_grad_()
    seen = inputs(network, Generator().manual_seed(9))
    q = make_stacked_q(alone[0])(stacked, seen)
    (q * torch.arange(7)).sum().backward()
    for k, one in enumerate(alone):
        own = one(seen[k])
        torch.testing.assert_close(q[k], own, rtol=1e-4, atol=1e-4)
        (own * torch.arange(7)).sum().backward()
        for name, parameter in one.named_parameters():
            gradient = stacked[name].grad
            assert gradient is not None and parameter.grad is not None
            scale = parameter.grad.abs().max()
            torch.testing.assert_close(gradient[k], parameter.grad, rtol=1e-3, atol=1e-4 * float(scale))


@pytest.mark.parametrize(
    "layer", [ConvLayer(1, 4, 2, 20), ConvLayer(1, 3, 1, 9), ConvLayer(1, 3, 2, 8), ConvLayer(1, 2, 3, 10)]
)
def test_windows_are_those_of_a_convolution(layer: ConvLayer) -> None:
    maps = torch.rand(2, layer.below, layer.below, 5, dtype=torch.float64, requires_grad=True)
    weight = torch.rand(6, 5, layer.kernel, layer.kernel, dtype=torch.float64)
    product = Windows.apply(maps, layer) @ weight.permute(0, 2, 3, 1).flatten(1).T
    wanted = torch.nn.functional.conv2d(maps.permute(0, 3, 1, 2), weight, stride=layer.stride)
    torch.testing.assert_close(product.view(2, layer.side, layer.side, 6), wanted.permute(0, 2, 3, 1))
    factors = torch.rand_like(wanted)
    (wanted_gradient,) = torch.autograd.grad((wanted * factors).sum(), maps)
    (gradient,) = torch.autograd.grad(
        (product.view_as(factors.permute(0, 2, 3, 1)) * factors.permute(0, 2, 3, 1)).sum(), maps
    )
    torch.testing.assert_close(gradient, wanted_gradient, rtol=1e-5, atol=1e-5)
