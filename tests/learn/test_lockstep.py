"""Several agents learn in step as one: network, loss, optimiser and target are functions of parameters."""

from typing import Any

import torch
from tensordict import TensorDict
from torch import Generator, Tensor
from torch.func import functional_call, grad, stack_module_state, vmap

from ship_trl.config.types import BackendName, Learn, World
from ship_trl.learn.algorithm import Setup
from ship_trl.learn.double_dqn import DoubleDQN, build
from ship_trl.learn.loss import double_dqn_target, td_loss
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam
from ship_trl.sim.cases import load_case
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.render import Rasteriser
from tests.learn.worlds import schedule

AGENTS, BATCH, UPDATES = 3, 16, 5
# Adam divides a gradient by its size: where it is near zero, a larger rate would show the rounding.
LEARNING_RATE = 1e-4
Parameters = dict[str, Tensor]


def batches(world: World, draw: Rasteriser) -> TensorDict:
    """Return transitions of every agent, [AGENTS, BATCH], whose pixels one rasteriser draws in one call."""
    chance, steps = Generator().manual_seed(1), []
    env = ShipEnv(load_case("4", world), world, AGENTS)
    current = env.reset()
    for _ in range(BATCH):
        action = torch.randint(7, (AGENTS,), generator=chance)
        stepped, current = env.step_and_maybe_reset(current.set("action", action))
        steps.append(stepped.clone())
    batch: Any = torch.stack(steps, 1)
    batch.set("pixels", draw(batch.get("state")))
    batch.set(("next", "pixels"), draw(batch.get(("next", "state"))))
    return batch.set(("next", "reward"), batch.get(("next", "reward")) * 0.01)


def stacked(networks: list[DuelingNetwork]) -> Parameters:
    """Return the parameters of several networks, each [AGENTS, ...]."""
    return {name: value.detach().clone() for name, value in stack_module_state(networks)[0].items()}


def lockstep(agents: list[DoubleDQN], learn: Learn, batch: TensorDict) -> tuple[Parameters, ...]:
    """Update all agents at once; return the first gradients, and online and target parameters at the end."""
    network = DuelingNetwork(1, 7, Generator())
    online = stacked([agent.online_network for agent in agents])
    target = stacked([agent.network for agent in agents])
    optimiser = ChannelsLastAdam(online.values(), lr=learn.lr)
    first: Parameters = {}

    def loss(online: Parameters, target: Parameters, *data: Tensor) -> Tensor:
        pixels, action, next_pixels, reward, terminated = data
        q = lambda parameters, seen: functional_call(network, parameters, (seen,))  # noqa: E731
        with torch.no_grad():
            wanted = double_dqn_target(
                q(online, next_pixels), q(target, next_pixels), reward, terminated, learn.gamma
            )
        chosen = q(online, pixels).gather(-1, action[:, None])
        return td_loss(chosen, wanted, learn.loss, learn.huber_delta)

    keys: Any = "pixels", "action", ("next", "pixels"), ("next", "reward"), ("next", "terminated")
    for _ in range(UPDATES):
        gradients = vmap(grad(loss))(online, target, *(batch[key] for key in keys))
        first = first or gradients
        for name, parameter in online.items():
            parameter.grad = gradients[name]
        optimiser.step()
        for name, parameter in target.items():
            parameter.lerp_(online[name], learn.tau)
    return first, online, target


def test_agents_in_lockstep_equal_agents_alone(world: World) -> None:
    draw, learn = Rasteriser(world), schedule(backend=BackendName.dense, lr=LEARNING_RATE)
    networks = [DuelingNetwork(1, 7, Generator().manual_seed(seed)) for seed in range(AGENTS)]
    agents = [build(Setup(network, draw, 7, learn, Generator(), Generator())) for network in networks]
    batch = batches(world, draw)
    gradients, online, target = lockstep(agents, learn, batch)
    before = [network.advantage.weight.detach().clone() for network in networks]
    for n, agent in enumerate(agents):
        agent.learn_from(batch[n])
        for name, parameter in agent.online_network.named_parameters():
            torch.testing.assert_close(gradients[name][n], parameter.grad, rtol=1e-5, atol=1e-5)
        for _ in range(UPDATES - 1):
            agent.learn_from(batch[n])
        assert not torch.allclose(agent.online_network.advantage.weight, before[n], atol=1e-4)
        for found, network in ((online, agent.online_network), (target, agent.network)):
            for name, parameter in network.named_parameters():
                torch.testing.assert_close(found[name][n], parameter.detach(), rtol=1e-5, atol=1e-5)
