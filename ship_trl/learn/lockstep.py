"""Many agents that learn side by side: one operation serves them all.

A small network spends most of its time on starting operations. Here the parameters of all agents are stacked,
[K, ...]. Each agent has its own environments, replay and random streams, and learns by double DQN with n-step
targets. An agent's results do not depend on the others, but for rounding. Budgets and schedules count
environment steps, not episodes; random numbers are drawn in another way than in a single run.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import torch
import torch.nn.functional as F
from torch import Generator, Tensor
from torch.func import functional_call, stack_module_state, vmap

from ship_trl.config.network import ConvLayer
from ship_trl.config.types import Learn
from ship_trl.learn.algorithm import epsilon_at, learning_rate_at
from ship_trl.learn.network import DuelingNetwork, choose_dtype
from ship_trl.learn.optimiser import ChannelsLastAdam
from ship_trl.learn.q_learning import Batch, double_dqn_loss, sum_rewards, update

# Random numbers that each generator draws at once.
CHUNK = 64
Parameters = Mapping[str, Tensor]
# Maps stacked parameters and inputs [K, B, ...] to Q-values, float32 [K, B, A].
StackedQ = Callable[[Parameters, Tensor], Tensor]
# Maps states [N, S] and actions int64 [N] to what follows: `state` [N, S], `reward` [N], and bool [N] `goal`,
# `collision` and `truncated`.
Step = Callable[[Tensor, Tensor], Any]


class Windows(torch.autograd.Function):
    """All windows of maps: [N, H, W, C] to [N * side * side, kernel * kernel * C].

    A conv layer is then one matrix product for all networks. As a grouped convolution, to which torch turns
    stacked filters, its gradient is slow.
    """

    @staticmethod
    def forward(ctx: Any, maps: Tensor, layer: ConvLayer) -> Tensor:
        """Copy the windows."""
        ctx.layer, ctx.shape, ctx.dtype = layer, maps.shape, maps.dtype
        windows = maps.unfold(1, layer.kernel, layer.stride).unfold(2, layer.kernel, layer.stride)
        return windows.permute(0, 1, 2, 4, 5, 3).reshape(-1, layer.kernel**2 * maps.shape[-1])

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        """Sum up the gradients of each place of the maps, in float32."""
        (gradient,), layer, (count, _, _, channels) = gradients, ctx.layer, ctx.shape
        side, kernel, stride = layer.side, layer.kernel, layer.stride
        windows = gradient.view(count, side, side, kernel, kernel, channels)
        found = gradient.new_zeros(ctx.shape, dtype=torch.float32)
        for row in range(kernel):
            for column in range(kernel):
                rows, columns = (slice(at, at + stride * side - stride + 1, stride) for at in (row, column))
                found[:, rows, columns] += windows[:, :, :, row, column]
        return found.to(ctx.dtype), None


def make_stacked_q(network: DuelingNetwork, dtype: torch.dtype = torch.float32) -> StackedQ:
    """Make the function that computes the Q-values of stacked networks.

    Args:
        network: one like all of them; its weights are not used.
        dtype: of the layers below `shared`, if these are conv layers; else all layers compute in float32.
    """
    if not network.geometry:
        return vmap(lambda parameters, seen: functional_call(network, dict(parameters), (seen,)))

    def q_values(parameters: Parameters, pixels: Tensor) -> Tensor:
        x = pixels.flatten(0, 1).permute(0, 2, 3, 1).to(dtype)
        for name, layer in zip(network.layer_names, network.geometry, strict=True):
            windows = x.flatten(1) if layer.whole else Windows.apply(x, layer)
            weight, bias = layer_of(name, parameters)
            # The order of a window: rows, columns, channels.
            weight = weight.permute(0, 1, 3, 4, 2).flatten(2)
            if name == network.layer_names[0]:  # pixels are from 0 to 255: fewer weights than pixels
                weight = weight / 255
            weight, bias = weight.to(dtype), bias.to(dtype)
            x = F.relu(linear(windows.unflatten(0, (len(bias), -1)), weight, bias))
            x = x.view(-1, layer.side, layer.side, layer.filters)
        hidden = x.float().view(*pixels.shape[:2], -1)
        hidden = F.relu(linear(hidden, *layer_of("shared", parameters)))
        value, advantage = (linear(hidden, *layer_of(name, parameters)) for name in ("value", "advantage"))
        return value + advantage - advantage.mean(-1, keepdim=True)

    return q_values


def linear(inputs: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Apply a linear layer of each network: inputs [K, B, I], weight [K, O, I] and bias [K, O]."""
    return torch.baddbmm(bias[:, None], inputs, weight.mT)


def layer_of(name: str, parameters: Parameters) -> tuple[Tensor, Tensor]:
    """Return the stacked weight and bias of a layer."""
    return parameters[f"{name}.weight"], parameters[f"{name}.bias"]


def draw_numbers(generators: Sequence[Generator], *shape: int, device: torch.device) -> Iterator[Tensor]:
    """Yield uniform numbers from 0 to 1 of K generators, which do not depend on one another: [K, ...]."""
    while True:
        drawn = [torch.rand((CHUNK, *shape), generator=generator) for generator in generators]
        yield from torch.stack(drawn, 1).to(device)


class Lockstep:
    """K agents; agent k begins each episode in the state `begin[k]`.

    All is computed where `begin` lies.

    Args:
        networks: of each agent, with its initial weights; all of the same layers.
        frozen: names of the layers of each agent that do not learn.
        begin: initial states, float32 [K, S].
        step: see `Step`.
        observe: maps states [..., S] to what a network sees [..., F].
        learn: settings; `episodes` only scales its schedules.
        n: rewards before a target bootstraps.
        total: environment steps of each agent.
        exploration: a generator for each agent, for its actions.
        replay: a generator for each agent, for its batches.
        capture: makes CUDA graphs of acting and gradient steps; None for none.
    """

    def __init__(
        self,
        networks: Sequence[DuelingNetwork],
        frozen: Sequence[Collection[str]],
        begin: Tensor,
        step: Step,
        observe: Callable[[Tensor], Tensor],
        learn: Learn,
        n: int,
        total: int,
        exploration: Sequence[Generator],
        replay: Sequence[Generator],
        *,
        capture: Callable[[Callable[..., Any]], Callable[..., Any]] | None = None,
    ) -> None:
        self.step, self.observe, self.learn, self.n, self.total = step, observe, learn, n, total
        count, device = len(networks), begin.device
        self.num_actions = networks[0].advantage.out_features
        stacked, _ = stack_module_state(list(networks))
        self.target: Parameters = {
            name: as_filters(value.detach().to(device)) for name, value in stacked.items()
        }
        self.online: Parameters = {
            name: value.clone().requires_grad_() for name, value in self.target.items()
        }
        for name, value in self.online.items():
            learns = torch.tensor([float(name.split(".")[0] not in one) for one in frozen], device=device)
            learns = learns.view(-1, *[1] * (value.dim() - 1))
            value.register_hook(lambda gradient, learns=learns: gradient * learns)
        self._q = make_stacked_q(networks[0], choose_dtype(learn.precision, device))
        self._exact_q = make_stacked_q(networks[0])
        captured = capture or (lambda function: function)
        self._choose, self._learn = captured(self._best_actions), captured(self._learn_from)
        self._optimiser = ChannelsLastAdam(self.online.values(), lr=learn.lr)
        envs, batch = learn.num_envs, learn.batch_size
        self._begin = begin[:, None].expand(count, envs, -1)
        self.state = self._begin.clone()
        self.steps = self.updates = 0
        # The last `size` steps of each environment: [size, K, E, ...].
        self._size = min(learn.replay_size, total) // envs
        shape = (self._size, count, envs)
        self._before, self._after = (begin.new_empty(*shape, begin.shape[-1]) for _ in range(2))
        self._action = begin.new_empty(shape, dtype=torch.int64)
        self._reward = begin.new_empty(shape)
        self._ends, self._terminated = (begin.new_empty(shape, dtype=torch.bool) for _ in range(2))
        self._explore = draw_numbers(exploration, 2, envs, device=device)
        self._sample = draw_numbers(replay, 2, batch, device=device)

    def train(self, steps: int) -> None:
        """Take at least `steps` environment steps with each agent, and make the updates that are due."""
        end = self.steps + steps
        while self.steps < end:
            self._act()
            due = max(0, self.steps - self.learn.warmup_steps) // self.learn.update_every
            while self.updates < due:
                self._optimiser.set_lr(learning_rate_at(self._share(), self.learn))
                self._learn(*self.sample())
                self.updates += 1

    def _share(self) -> float:
        """Return the episodes that correspond to the steps taken."""
        return self.steps / self.total * self.learn.episodes

    @torch.no_grad()
    def _act(self) -> None:
        """Step all environments once, and store the step."""
        explore, chosen = next(self._explore).unbind(1)
        best = self._choose(self.state)
        is_random = explore < epsilon_at(self._share(), self.learn)
        action = torch.where(is_random, (chosen * self.num_actions).long(), best)
        after = self.step(self.state.flatten(0, 1), action.flatten())
        shape = self.state.shape[:2]
        terminated = (after.goal | after.collision).view(shape)
        ends = terminated | after.truncated.view(shape)
        reward, following = after.reward.view(shape), after.state.view(self.state.shape)
        row = self.steps // self.learn.num_envs % self._size
        self._before[row], self._after[row], self._action[row] = self.state, following, action
        self._reward[row], self._ends[row], self._terminated[row] = reward, ends, terminated
        self.state = torch.where(ends[..., None], self._begin, following)
        self.steps += self.learn.num_envs

    def _best_actions(self, state: Tensor) -> Tensor:
        """Return the actions that the online networks rate highest: states [K, E, S] to int64 [K, E]."""
        return self._q(self.online, self.observe(state)).argmax(-1)

    def sample(self) -> tuple[Tensor, ...]:
        """Draw a batch of each agent: states, actions, reward sums, next states, terminated, and steps.

        Shapes: [K, B, S], [K, B], [K, B, 1], [K, B, S], [K, B, 1], [K, B, 1].
        """
        count, kept = len(self.state), self.steps // self.learn.num_envs
        held = min(kept, self._size)
        age, place = next(self._sample).unbind(1)
        agent = torch.arange(count, device=age.device)[:, None]
        env = (place * self.learn.num_envs).long()
        # Counted from the oldest row.
        number = (age * held).long()
        oldest = kept - held

        def place_of(number: Tensor) -> tuple[Tensor, ...]:
            return (oldest + number) % self._size, agent, env

        reward, last, length = sum_rewards(
            self.n,
            self.learn.gamma,
            number,
            lambda number: (self._reward[place_of(number)], self._ends[place_of(number)]),
            lambda number: (number + 1, number + 1 < held),
        )
        first, at = place_of(number), place_of(last)
        return (
            self._before[first],
            self._action[first],
            reward[..., None],
            self._after[at],
            self._terminated[at][..., None],
            length[..., None],
        )

    def _learn_from(self, states: Tensor, action: Tensor, *rest: Tensor) -> Tensor:
        """Take one gradient step of each agent, and move its target network; return the loss."""
        learn, (reward, following, terminated, length) = self.learn, rest
        batch = Batch(
            self.observe(states),
            action,
            reward * learn.reward_scale,
            self.observe(following),
            terminated,
            learn.gamma**length,
        )
        networks = partial(self._q, self.online), partial(self._q, self.target)
        loss, _ = double_dqn_loss(*networks, batch, learn.loss, learn.huber_delta)
        # The mean over the agents times their number: the sum of their losses.
        parameters = [value.detach() for value in self.online.values()], list(self.target.values())
        return update(len(action) * loss, *parameters, self._optimiser, learn.tau)

    def evaluate(self, begin: Tensor) -> tuple[Tensor, Tensor]:
        """Run greedy episodes: return their returns, float64 [K, M], and if they reach the goal, bool [K, M].

        Agent k begins in the states `begin[k]` [M, S]. The target networks choose, in float32, as in a run.
        """
        returns, reached, _ = roll_out(self.step, begin, lambda state, _: self.greedy_actions(state))
        return returns.cpu(), reached.cpu()

    def greedy_actions(self, state: Tensor) -> Tensor:
        """Return the actions that the target networks rate highest: states [K, M, S] to int64 [K, M]."""
        return self._exact_q(self.target, self.observe(state)).argmax(-1)

    def weights(self, agent: int) -> Parameters:
        """Return a copy of an agent's target network, which evaluations use."""
        return {name: value[agent].clone() for name, value in self.target.items()}


def as_filters(stacked: Tensor) -> Tensor:
    """Return stacked filters [K, O, C, H, W] in the memory order K, O, H, W, C; other tensors as they are."""
    if stacked.dim() != 5:
        return stacked
    return stacked.permute(0, 1, 3, 4, 2).contiguous().permute(0, 1, 4, 2, 3)


@torch.no_grad()
def roll_out(
    step: Step, begin: Tensor, choose: Callable[[Tensor, int], Tensor]
) -> tuple[Tensor, Tensor, Tensor]:
    """Run an episode from each state [K, M, S]; `choose` maps states and the step to actions [K, M].

    Return the returns, float64 [K, M], if the goal is reached, bool [K, M], and the actions, [T, K, M].
    """
    state, actions = begin, list[Tensor]()
    returns = begin.new_zeros(begin.shape[:-1], dtype=torch.float64)
    running = torch.ones_like(returns, dtype=torch.bool)
    reached = torch.zeros_like(running)
    while bool(running.any()):
        chosen = choose(state, len(actions))
        # An episode that has ended keeps its last action.
        actions.append(torch.where(running, chosen, actions[-1]) if actions else chosen)
        after = step(state.flatten(0, 1), chosen.flatten())
        goal, reward = (one.view(running.shape) for one in (after.goal, after.reward))
        returns += reward * running
        reached |= goal & running
        running &= ~(after.goal | after.collision | after.truncated).view(running.shape)
        state = after.state.view(state.shape)
    return returns, reached, torch.stack(actions)
