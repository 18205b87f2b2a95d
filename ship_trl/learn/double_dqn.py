"""Double DQN on replayed transitions: the paper's algorithm (section 3.2), and the default."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor
from torchrl.modules import QValueActor
from torchrl.objectives import SoftUpdate

from ship_trl.config.types import Learn
from ship_trl.learn.algorithm import LearningHooks, Setup, epsilon_at, learning_rate_at
from ship_trl.learn.backend import Draw, make_backend
from ship_trl.learn.network import Dense, DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam, learning_groups
from ship_trl.learn.policy import EpsilonGreedy, greedy_policy
from ship_trl.learn.prefix import add_prefix, copy_exactly, strip_prefix
from ship_trl.learn.q_learning import DoubleDQNLoss, update
from ship_trl.learn.replay import DrawPixels, StateReplay, make_batch
from ship_trl.learn.rollout import Policy

# Key of the observations of frozen layers, which the replay stores next to states.
FEATURES = "features"
# Makes a function that does the same with less overhead.
Capture = Callable[[Callable[..., Any]], Callable[..., Any]]


class DoubleDQN:
    """Acts by an exploring policy, stores what follows, and learns from batches of it.

    The online network explores, as in the paper. Evaluations use the target network, which is the running
    average of the online network over the last 1/tau updates. Q-values of actions are often almost equal
    (one second at 12 m/s instead of 15 costs 0.7 of a return of 84). So each update changes some choices
    of the online network, but few of the average.

    Args:
        loss: of a batch, with the online and the target network.
        optimiser: of the layers that learn.
        replay: stores the transitions and draws batches.
        policy: explores.
        draw: maps states to the network's input.
        learn: the schedule of updates, exploration and learning rate.
        method: what a transfer asks of learning.
        encoders: see `Algorithm`.
        capture: makes a CUDA graph of gradient steps; None for none.
    """

    def __init__(
        self,
        loss: DoubleDQNLoss,
        optimiser: ChannelsLastAdam,
        replay: StateReplay,
        policy: EpsilonGreedy,
        draw: Draw,
        learn: Learn,
        method: LearningHooks | None = None,
        encoders: Mapping[str, Callable[[Tensor], Tensor]] | None = None,
        capture: Capture | None = None,
    ) -> None:
        self.loss, self.optimiser = loss, optimiser
        self.replay, self.policy, self._draw, self._learn = replay, policy, draw, learn
        self._method: LearningHooks = method or LearningHooks()
        self.encoders: Mapping[str, Callable[[Tensor], Tensor]] = dict(encoders or {})
        self.online_network: DuelingNetwork = loss.network
        self.dtype = self.online_network.backend.dtype
        self.backend = self.online_network.backend.name
        # Environment steps and updates so far.
        self.steps = self.updates = 0
        # A loss of one's own may write into the batch or draw numbers.
        is_plain = not loss.write_td_error and type(loss).forward is DoubleDQNLoss.forward
        self._capture = capture if is_plain else None
        # Else TorchRL warns that nothing moves the target network; `update` does.
        SoftUpdate(loss, tau=learn.tau)
        # Evaluations compute whole frames in float32.
        self.network: DuelingNetwork = copy.copy(loss.target_network)
        self.network.backend = Dense()
        self.greedy: Policy = greedy_policy(self.network, draw)
        self._find_learning()

    def _find_learning(self) -> None:
        """Find the parameters that learn, and capture gradient steps anew: a graph has its parameters."""
        online, target = self.online_network.named_parameters(), self.network.state_dict()
        learning = {name: parameter for name, parameter in online if parameter.requires_grad}
        self._learning = list(learning.values()), [target[name] for name in learning]
        self._graph = GradientStep(self._learn_from, self._capture) if self._capture else None

    @property
    def epsilon(self) -> float:
        """Share of random actions."""
        return self.policy.epsilon

    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action`, when `episode` training episodes have ended."""
        self.policy.epsilon = epsilon_at(episode, self._learn)
        if self._method.thaws:
            self.freeze(self._method.frozen_layers(episode / self._learn.episodes))
        self.optimiser.set_lr(learning_rate_at(episode, self._learn))
        self.steps += step.batch_size[0]
        step = self.policy(step)
        self._method.act(step, episode / self._learn.episodes)
        return step

    def observe(self, step: TensorDictBase) -> None:
        """Store a step."""
        if self.steps:  # demonstrations come before
            self._method.observe(step)
        self.replay.extend(step)

    def update(self) -> list[Tensor]:
        """Make the updates that are due, and return their losses."""
        learn, losses = self._learn, []
        due = max(0, self.steps - learn.warmup_steps) // learn.update_every
        while self.updates < due:
            losses.append(self.learn_from(self.replay.sample(learn.batch_size)))
            self.updates += 1
        return losses

    def learn_from(self, batch: TensorDictBase) -> Tensor:
        """Take one gradient step on a batch, update the target network, and return the loss."""
        return self._learn_from(batch) if self._graph is None else self._graph(batch)

    def _learn_from(self, batch: TensorDictBase) -> Tensor:
        """Do what `learn_from` says, one operation after the other."""
        loss = self.loss(batch)["loss"]
        if (penalty := self._method.penalty(self.online_network, batch)) is not None:
            loss = loss + penalty
        return update(loss, *self._learning, self.optimiser, self._learn.tau)

    def freeze(self, layers: int) -> None:
        """Freeze the first `layers` layers, and let the others learn."""
        if layers == self.online_network.frozen:
            return
        for network in (self.online_network, self.loss.target_network, self.network):
            network.frozen = layers
        self.online_network.freeze(layers)
        self.loss.share_frozen()
        self.optimiser.add_thawed(self.online_network)
        self._find_learning()

    def state_dict(self) -> dict[str, Tensor]:
        """Return networks, Adam's averages, replay, generators and counters; tensors are not copied."""
        online, target = self.online_network.state_dict(), self.network.state_dict()
        # Both networks share the tensors of frozen layers.
        own = {key: value for key, value in target.items() if value.data_ptr() != online[key].data_ptr()}
        return (
            add_prefix("online", online)
            | add_prefix("target", own)
            | add_prefix("adam", self.optimiser.averages(self.online_network))
            | add_prefix("replay", self.replay.compact_state_dict())
            | add_prefix("method", self._method.state_dict())
            | {"exploration": self.policy.generator.get_state()}
            | {"counters": torch.tensor([self.steps, self.updates, self.online_network.frozen])}
        )

    @torch.no_grad()
    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned into the memory of these networks.

        Raises:
            KeyError, RuntimeError, TypeError: the state does not fit this algorithm.
        """
        if state["counters"].dtype is not torch.int64:
            raise TypeError("counters must be int64")
        self.steps, self.updates, frozen = state["counters"].tolist()
        self.freeze(frozen)
        for name, network in (("online", self.online_network), ("target", self.network)):
            for key, value in network.state_dict().items():
                copy_exactly(value, state.get(f"{name}.{key}", state[f"online.{key}"]))
        self.optimiser.load_averages(self.online_network, strip_prefix("adam", state))
        self.policy.generator.set_state(state["exploration"].cpu())
        self._method.load_state_dict(strip_prefix("method", state))
        self.replay.load_compact_state_dict(strip_prefix("replay", state))


class GradientStep:
    """Replays a gradient step on batches as a CUDA graph: `step(batch)` returns the loss."""

    def __init__(self, step: Callable[[TensorDictBase], Tensor], capture: Capture) -> None:
        self._keys: list[NestedKey] = []
        keys = self._keys
        self._captured = capture(lambda *values: step(make_batch(dict(zip(keys, values, strict=True)))))

    def __call__(self, batch: TensorDictBase) -> Tensor:
        """Take the step."""
        self._keys[:] = batch.keys(True, True)
        loss: Tensor = self._captured(*(batch.get(key) for key in self._keys))
        return loss


def build(
    setup: Setup,
    make_replay: Callable[..., StateReplay] = StateReplay,
    make_loss: type[DoubleDQNLoss] = DoubleDQNLoss,
    make: type[DoubleDQN] = DoubleDQN,
    n: int = 1,
) -> DoubleDQN:
    """Make double DQN, or one with another replay, loss or update, which take the same arguments.

    Targets bootstrap after `n` rewards.
    """
    network, draw, learn, method = setup.network, setup.draw, setup.learn, setup.method
    device = network.advantage.weight.device
    network.freeze(method.frozen_layers(0.0))
    network.backend = make_backend(network, draw, learn, setup.accelerator)
    is_incremental = not isinstance(network.backend, Dense)
    encoders: dict[str, Callable[[Tensor], Tensor]] = {}
    if network.config.linear:
        # Quick to read and small, so the replay stores them in place of states.
        encoders[network.observes] = draw
    elif (
        is_incremental
        and setup.accelerator.features is not None
        and not method.thaws
        and network.frozen >= network.linear_from
    ):
        encoders[FEATURES] = setup.accelerator.features(network, draw, network.backend.dtype)
    observation, network_input = "state", network.observes
    for key in encoders:
        observation = network_input = key
    actor = QValueActor(network, in_keys=[network_input], action_space="categorical")
    loss = make_loss(
        actor, kind=learn.loss, huber_delta=learn.huber_delta, gamma=learn.gamma, write_td_error=False
    )

    def best_actions(observed: Tensor) -> Tensor:
        return network(observed if encoders else draw(observed)).argmax(-1)

    # A graph keeps the numbers of its capture, such as a penalty's weight.
    captures = device.type == "cuda" and type(method).penalty is LearningHooks.penalty
    capture = setup.accelerator.capture if captures else None
    best = best_actions if capture is None else capture(best_actions)

    return make(
        loss=loss,
        optimiser=ChannelsLastAdam(learning_groups(network, method.rate_factor), lr=learn.lr),
        replay=make_replay(
            learn.replay_size,
            learn.reward_scale,
            setup.replay,
            device,
            observation,
            None if encoders else DrawPixels(draw),
            encode=encoders.get(FEATURES),
            **({"n": n, "gamma": learn.gamma} if n > 1 else {}),
        ),
        policy=EpsilonGreedy(best, observation, setup.num_actions, setup.exploration),
        draw=draw,
        learn=learn,
        method=method,
        encoders=encoders,
        capture=capture,
    )
