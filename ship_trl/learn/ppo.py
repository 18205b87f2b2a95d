"""Proximal policy optimisation (Schulman et al., 2017), by TorchRL's `ClipPPOLoss` and `GAE`.

Actor and critic are the two streams of the dueling network. Its outputs are value + advantage - mean of the
advantages: their softmax is that of the advantages, and their mean is the value. So one forward pass gives
both, and the greedy action, the files and the transfer of layers are the same as with Q-values.

With `imitation_coeff` it also imitates the best episode from each start.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Generator, Tensor, nn
from torch.distributions import Categorical
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from ship_trl.config.types import Learn
from ship_trl.learn import settings as settings_of
from ship_trl.learn.algorithm import DivergedError, LearningHooks, Setup, learning_rate_at
from ship_trl.learn.backend import Draw, make_backend
from ship_trl.learn.network import Dense, DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam, learning_groups, learning_parameters
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.prefix import add_prefix, strip_prefix
from ship_trl.learn.replay import join_key, make_batch
from ship_trl.learn.rollout import Policy

# Outputs of the network that acted, [N, A].
OUTPUT = "action_value"


def state_value(output: Tensor) -> Tensor:
    """Return the critic's values [..., 1] from the network's outputs [..., A]."""
    return output.mean(-1, keepdim=True)


def make_loss(settings: settings_of.PPO) -> ClipPPOLoss:
    """Make the loss of batches that hold the network's outputs; it has no parameters of its own."""
    outputs: list[NestedKey] = [OUTPUT]
    actor = ProbabilisticActor(
        TensorDictModule(nn.Identity(), in_keys=outputs, out_keys=["logits"]),
        in_keys=["logits"],
        distribution_class=Categorical,
        return_log_prob=True,
    )
    return ClipPPOLoss(
        actor,
        TensorDictModule(state_value, in_keys=outputs, out_keys=["state_value"]),
        clip_epsilon=settings.clip_epsilon,
        entropy_coeff=settings.entropy_coeff,
        critic_coeff=settings.critic_coeff,
        loss_critic_type="l2",
        functional=False,
    )


@dataclass(frozen=True)
class Best:
    """States [T, S] and actions [T] of an episode, and the undiscounted sum of its rewards."""

    states: Tensor
    actions: Tensor
    episode_return: float


class BestEpisodes:
    """Cuts episodes out of the steps of a batched environment, and keeps the best from each start.

    After self-imitation learning (Oh et al., 2018). That keeps all steps and imitates those whose return is
    above their value; this keeps one whole episode for each start: steps are deterministic here, so the same
    actions from the same start give the same return again. Starts must come again: each new one adds an
    episode to what is kept.
    """

    def __init__(self) -> None:
        self._best: dict[tuple[float, ...], Best] = {}
        # Whose turn it is in `take`.
        self._turn = 0
        # Steps [N] since the oldest running episode began; length and return of each row's episode so far.
        self._states: list[Tensor] = []
        self._actions: list[Tensor] = []
        self._lengths: list[int] = []
        self._returns: list[float] = []

    def __len__(self) -> int:
        return len(self._best)

    def observe(self, step: TensorDictBase) -> None:
        """Take note of a step [N] with `state`, `action`, and below `next` `reward` and `done`."""
        rewards, done = (step["next", key].squeeze(-1).tolist() for key in ("reward", "done"))
        count = len(rewards)
        self._states.append(step["state"].clone())
        self._actions.append(step["action"].clone())
        self._lengths = [length + 1 for length in self._lengths or [0] * count]
        self._returns = [a + b for a, b in zip(self._returns or [0.0] * count, rewards, strict=True)]
        for row in range(count):
            if done[row]:
                self._end(row)
        oldest = max(self._lengths)
        del self._states[: len(self._states) - oldest], self._actions[: len(self._actions) - oldest]

    def _end(self, row: int) -> None:
        """Keep the episode of a row if it is the best from its start, and begin another."""
        length, episode_return = self._lengths[row], self._returns[row]
        self._lengths[row], self._returns[row] = 0, 0.0
        start = tuple(self._states[-length][row].tolist())
        if start not in self._best or episode_return > self._best[start].episode_return:
            states, actions = (
                torch.stack([step[row] for step in steps[-length:]])
                for steps in (self._states, self._actions)
            )
            self._best[start] = Best(states, actions, episode_return)

    def take(self) -> Best:
        """Return the best episode from one of the starts, each in turn."""
        best = list(self._best.values())[self._turn % len(self._best)]
        self._turn += 1
        return best

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs."""
        best = list(self._best.values())
        tensors = {
            "lengths": self._lengths,
            "best_lengths": [len(one.actions) for one in best],
            "turn": self._turn,
        }
        state = {name: torch.tensor(value, dtype=torch.int64) for name, value in tensors.items()}
        returns = {"returns": self._returns, "best_returns": [one.episode_return for one in best]}
        state |= {name: torch.tensor(value, dtype=torch.float64) for name, value in returns.items()}
        if self._states:
            state |= {"states": torch.stack(self._states), "actions": torch.stack(self._actions)}
        if best:
            state["best_states"] = torch.cat([one.states for one in best])
            state["best_actions"] = torch.cat([one.actions for one in best])
        return state

    def load_state_dict(self, state: Mapping[str, Tensor], device: torch.device) -> None:
        """Load what `state_dict` returned."""
        self._lengths, self._returns = state["lengths"].tolist(), state["returns"].tolist()
        self._turn = int(state["turn"])
        self._states, self._actions = (
            list(state[key].to(device)) if key in state else [] for key in ("states", "actions")
        )
        self._best = {}
        if "best_states" in state:
            lengths = state["best_lengths"].tolist()
            parts = (state[key].to(device).split(lengths) for key in ("best_states", "best_actions"))
            for states, actions, value in zip(*parts, state["best_returns"].tolist(), strict=True):
                self._best[tuple(states[0].tolist())] = Best(states, actions, value)


class PPO:
    """Acts by the actor's probabilities, and learns from each rollout in several passes.

    A rollout is `rollout_steps` steps of all environments. It holds states; pixels are drawn for a minibatch.

    Args:
        network: actor and critic.
        draw: maps states to the network's input.
        learn: discount, scale of the rewards, schedule of the learning rate.
        settings: the keys of the algorithm.
        exploration: draws the actions.
        shuffle: orders the steps of a rollout.
        method: what a transfer asks of learning.
    """

    epsilon = math.nan

    def __init__(
        self,
        network: DuelingNetwork,
        draw: Draw,
        learn: Learn,
        settings: settings_of.PPO,
        exploration: Generator,
        shuffle: Generator,
        method: LearningHooks,
    ) -> None:
        self.online_network, self._draw, self._learn, self._settings = network, draw, learn, settings
        self._exploration, self._shuffle, self._method = exploration, shuffle, method
        self.dtype, self.backend = network.backend.dtype, network.backend.name
        self.encoders: Mapping[str, Callable[[Tensor], Tensor]] = {}
        self.loss = make_loss(settings)
        # Advantages are scaled to unit variance over the rollout.
        self.estimate = GAE(
            gamma=learn.gamma, lmbda=settings.gae_lambda, value_network=None, average_gae=True, time_dim=0
        )
        self.optimiser = ChannelsLastAdam(learning_groups(network, method.rate_factor), lr=learn.lr)
        self._rollout: list[dict[NestedKey, Tensor]] = []
        self._output: Tensor | None = None
        self._best = BestEpisodes() if settings.imitation_coeff else None
        self._imitates = False
        # Evaluations compute whole frames in float32.
        self.network: DuelingNetwork = copy.copy(network)
        self.network.backend = Dense()
        self.greedy: Policy = greedy_policy(self.network, draw)

    @torch.no_grad()
    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action`, when `episode` training episodes have ended."""
        if self._method.thaws:
            self.freeze(self._method.frozen_layers(episode / self._learn.episodes))
        self.optimiser.set_lr(learning_rate_at(episode, self._learn))
        self._imitates = episode >= self._settings.imitation_start * self._learn.episodes
        self._output = check_finite(self.online_network(self._draw(step["state"])))
        action = torch.multinomial(self._output.softmax(-1), 1, generator=self._exploration)
        return step.set("action", action.squeeze(-1))

    def observe(self, step: TensorDictBase) -> None:
        """Add a step to the rollout."""
        assert self._output is not None, "call act() first"
        if self._best is not None:
            self._best.observe(step)
        following = step["next"]
        self._rollout.append(
            {
                "state": step["state"].clone(),
                "action": step["action"].clone(),
                OUTPUT: self._output,
                ("next", "state"): following["state"].clone(),
                ("next", "reward"): following["reward"] * self._learn.reward_scale,
                ("next", "done"): following["done"].clone(),
                ("next", "terminated"): following["terminated"].clone(),
            }
        )

    def update(self) -> list[Tensor]:
        """Learn from the rollout if it is full, and return the loss of each minibatch."""
        if len(self._rollout) < self._settings.rollout_steps:
            return []
        steps = self.judge(self._stacked()).flatten()
        self._rollout.clear()
        return [
            self.learn_from(steps[rows])
            for _ in range(self._settings.epochs)
            for rows in self._shuffled(len(steps)).split(self._settings.minibatch_size)
        ]

    def _shuffled(self, count: int) -> Tensor:
        """Return the numbers below `count` in random order."""
        return torch.randperm(count, generator=self._shuffle, device=self._shuffle.device)

    def _stacked(self) -> dict[NestedKey, Tensor]:
        """Return the rollout so far as tensors [T, N, ...]."""
        return {key: torch.stack([step[key] for step in self._rollout]) for key in self._rollout[0]}

    @torch.no_grad()
    def judge(self, entries: Mapping[NestedKey, Tensor]) -> TensorDict:
        """Return a rollout [T, N] with `advantage`, `value_target` and the probabilities of its actions."""
        steps = make_batch(dict(entries))
        output, action = steps[OUTPUT], steps["action"].unsqueeze(-1)
        steps["action_log_prob"] = output.log_softmax(-1).gather(-1, action).squeeze(-1)
        steps["state_value"] = state_value(output)
        # The next step begins where this one ends, unless the environment was reset between them.
        value = steps["state_value"].roll(-1, 0)
        ends = steps["next", "done"].squeeze(-1).clone()
        ends[-1] = True
        after = steps["next", "state"][ends].split(self._settings.minibatch_size)
        value[ends] = torch.cat([state_value(self.online_network(self._draw(one))) for one in after])
        steps["next", "state_value"] = value
        # A truncated step is not terminated, so it bootstraps.
        return self.estimate(steps).select("state", "action", "action_log_prob", "advantage", "value_target")

    def learn_from(self, batch: TensorDictBase) -> Tensor:
        """Take one gradient step on a minibatch [B], and return the loss."""
        seen = self._draw(batch["state"])
        output = check_finite(self.online_network(seen))
        batch = batch.set(self.online_network.observes, seen).set(OUTPUT, output)
        parts = self.loss(batch)
        loss: Tensor = parts["loss_objective"] + parts["loss_critic"] + parts["loss_entropy"]
        if self._imitates and self._best:
            loss = loss - self._settings.imitation_coeff * self._log_likelihood(self._best.take())
        if (penalty := self._method.penalty(self.online_network, batch)) is not None:
            loss = loss + penalty
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(learning_parameters(self.online_network), self._settings.max_grad_norm)
        self.optimiser.step()
        return loss.detach()

    def _log_likelihood(self, best: Best) -> Tensor:
        """Return the mean log probability of an episode's actions."""
        output = check_finite(self.online_network(self._draw(best.states)))
        return output.log_softmax(-1).gather(-1, best.actions.unsqueeze(-1)).mean()

    def freeze(self, layers: int) -> None:
        """Freeze the first `layers` layers, and let the others learn."""
        if layers != self.online_network.frozen:
            self.online_network.freeze(layers)
            self.optimiser.add_thawed(self.online_network)

    def state_dict(self) -> dict[str, Tensor]:
        """Return network, Adam's averages, the rollout so far, and generators; tensors are not copied."""
        rollout = self._stacked() if self._rollout else {}
        return {
            **add_prefix("online", self.online_network.state_dict()),
            **add_prefix("adam", self.optimiser.averages(self.online_network)),
            **add_prefix("best", self._best.state_dict() if self._best is not None else {}),
            **add_prefix("rollout", {join_key(key): value for key, value in rollout.items()}),
            "exploration": self._exploration.get_state(),
            "shuffle": self._shuffle.get_state(),
            "frozen": torch.tensor(self.online_network.frozen),
        }

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned into the memory of this network.

        Raises:
            KeyError, RuntimeError, TypeError, ValueError: the state does not fit this algorithm.
        """
        self.freeze(int(state["frozen"]))
        self.online_network.load_state_dict(strip_prefix("online", state))
        self.optimiser.load_averages(self.online_network, strip_prefix("adam", state))
        device = self.online_network.advantage.weight.device
        rollout = TensorDict(strip_prefix("rollout", state)).to(device)
        rows: dict[NestedKey, Tensor] = {
            tuple(name.split(".")) if "." in name else name: v for name, v in rollout.items()
        }
        count = len(rows["action"]) if rows else 0
        self._rollout = [{key: value[time] for key, value in rows.items()} for time in range(count)]
        if self._best is not None:
            self._best.load_state_dict(strip_prefix("best", state), device)
        self._exploration.set_state(state["exploration"].cpu())
        self._shuffle.set_state(state["shuffle"].cpu())


def check_finite(output: Tensor) -> Tensor:
    """Return outputs of the network, from which probabilities are made.

    Raises:
        DivergedError: one is not finite.
    """
    if not bool(output.isfinite().all()):
        raise DivergedError("an output of the network is not finite")
    return output


def build(setup: Setup) -> PPO:
    """Make PPO with the settings of `config.algorithm`."""
    network, learn = setup.network, setup.learn
    network.freeze(setup.method.frozen_layers(0.0))
    network.backend = make_backend(network, setup.draw, learn, setup.accelerator)
    options = {key: value for key, value in setup.options.items() if key != "build"}
    settings = settings_of.PPO(**options)
    return PPO(network, setup.draw, learn, settings, setup.exploration, setup.replay, setup.method)
