"""Double DQN on replayed transitions: the paper's algorithm (section 3.2), and the default."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor

from ship_trl.learn.algorithm import Algorithm, Setup, add_prefix, epsilon_at, strip_prefix
from ship_trl.learn.hooks import LearningHooks
from ship_trl.learn.masks import ACTION_MASK, mask_values
from ship_trl.learn.network import Dense, Draw, DuelingNetwork
from ship_trl.learn.q_learning import double_dqn_loss, read_batch, update
from ship_trl.learn.replay import DrawStates, StateReplay, make_batch
from ship_trl.learn.rollout import EpsilonGreedy

# Key of the observations of frozen layers, which the replay stores next to states.
FEATURES = "features"


class DoubleDQN(Algorithm):
    """Acts by an exploring policy, stores what follows, and learns from batches of it.

    The online network explores, as in the paper. Evaluations use the target network, which is the running
    average of the online network over the last 1/tau updates. Q-values of actions are often almost equal
    (one second at 12 m/s instead of 15 costs 0.7 of a return of 84). So each update changes some choices
    of the online network, but few of the average.

    An algorithm of one's own overrides `sample`, `loss`, `learn_from` or `best_actions`.

    Args:
        setup: its parts.
        n: rewards before a target bootstraps.
        make_replay: takes the arguments of `StateReplay`.

    Attributes:
        stored: key of the observations that the replay stores and the policy reads.
        observed: key of the observations in a batch.
    """

    def __init__(
        self, setup: Setup, n: int = 1, make_replay: Callable[..., StateReplay] = StateReplay
    ) -> None:
        super().__init__(setup)
        network, learn = self.online_network, self.learn
        device = network.advantage.weight.device
        encoders = self.make_encoders()
        self.encoders |= encoders
        self.observed = next(iter(encoders), network.observes)
        self.stored = next(iter(encoders), "state")
        self.replay = make_replay(
            learn.replay_size,
            learn.reward_scale,
            setup.replay,
            device,
            self.stored,
            None if encoders else DrawStates(self.draw, network.observes),
            encode=encoders.get(FEATURES),
            n=n,
            gamma=learn.gamma,
        )
        # A graph keeps the numbers of its capture, such as a penalty's weight.
        captures = device.type == "cuda" and type(self.method).penalty is LearningHooks.penalty
        self._capture = setup.accelerator.capture if captures else None
        best: Callable[..., Tensor] = self.best_actions
        if self._capture is not None and type(self).best_actions is DoubleDQN.best_actions:
            best = self._capture(best)
        key = None if self.mask is None else ACTION_MASK
        self.policy = EpsilonGreedy(best, self.stored, setup.num_actions, setup.exploration, key)
        # Environment steps and updates so far.
        self.steps = self.updates = 0
        self.target_network: DuelingNetwork = copy.deepcopy(network).requires_grad_(False)
        self.evaluate_with(self.target_network)
        self._find_learning()

    def make_encoders(self) -> dict[str, Draw]:
        """Return the observations that the replay stores beside states."""
        network = self.online_network
        never_learn = min(map(self.method.frozen_layers, (0.0, 1.0)))
        if network.geometry and never_learn >= network.linear_from and not isinstance(network.backend, Dense):
            return {FEATURES: self.frozen_features}
        return {}

    @torch.no_grad()
    def frozen_features(self, state: Tensor) -> Tensor:
        """Compute what the frozen layers make of states [N, S]: [N, K] in half precision.

        If only linear layers learn, the replay stores these next to states: slow to compute, quick to read.
        In the paper's network they are 3,136 numbers after the third layer (6 kB in half precision, a little
        less than a frame), and 200 after the fourth.
        """
        network = self.online_network
        # float16 has three more bits of mantissa than bfloat16, so it is better for float32 results.
        half = torch.bfloat16 if self.dtype is torch.bfloat16 else torch.float16
        # One by one, so that the bits do not depend on the batch: a resumed run recomputes the features.
        features = torch.cat([network.encode(self.draw(one), network.frozen) for one in state.split(1)])
        # float16 would store values above 65,504 as infinity. After ReLU no value is negative.
        return features.clamp_(max=torch.finfo(half).max).to(half)

    def _find_learning(self) -> None:
        """Find the parameters that learn, and capture gradient steps anew: a graph has its parameters.

        The target network uses the layers that do not learn, so that a backend computes them once.
        """
        online, target = dict(self.online_network.named_children()), self.target_network
        for name, layer in online.items():
            if not any(parameter.requires_grad for parameter in layer.parameters()):
                setattr(target, name, layer)
            elif getattr(target, name) is layer:
                setattr(target, name, copy.deepcopy(layer).requires_grad_(False))
        named, slow = self.online_network.named_parameters(), dict(target.named_parameters())
        learning = {name: parameter.detach() for name, parameter in named if parameter.requires_grad}
        self._learning = list(learning.values()), [slow[name].detach() for name in learning]
        # A loss of one's own may write into the batch or draw numbers.
        is_plain = type(self).loss is DoubleDQN.loss
        self._graph = self._capture(self._learn_from_values) if self._capture and is_plain else None

    def best_actions(self, observed: Tensor, allowed: Tensor | None = None) -> Tensor:
        """Return the allowed actions that the online network rates highest, int64 [N].

        `observed` are stored observations; `allowed`, bool [N, A], is given if there is a mask.
        """
        seen = self.draw(observed) if self.stored == "state" else observed
        return mask_values(self.online_network(seen), allowed).argmax(-1)

    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action`, when `episode` training episodes have ended."""
        progress = self.schedule(episode)
        self.epsilon = self.policy.epsilon = epsilon_at(episode, self.learn)
        self.steps += step.batch_size[0]
        step = self.policy(step)
        self.method.act(step, progress)
        return step

    def observe(self, step: TensorDictBase) -> None:
        """Store a step."""
        if self.steps:  # demonstrations come before
            self.method.observe(step)
        self.replay.extend(step)

    def update(self) -> list[Tensor]:
        """Make the updates that are due, and return their losses."""
        learn, losses = self.learn, []
        due = max(0, self.steps - learn.warmup_steps) // learn.update_every
        while self.updates < due:
            losses.append(self.learn_from(self.sample()))
            self.updates += 1
        return losses

    def sample(self) -> TensorDictBase:
        """Draw a batch."""
        return self.replay.sample(self.learn.batch_size)

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Return the mean loss of a batch."""
        transitions = read_batch(batch, self.observed, self.learn.gamma)
        networks = self.online_network, self.target_network
        return double_dqn_loss(*networks, transitions, self.learn.loss, self.learn.huber_delta)[0]

    def learn_from(self, batch: TensorDictBase) -> Tensor:
        """Take one gradient step on a batch, update the target network, and return the loss."""
        if self._graph is None:
            return self._learn_from(batch)
        self._keys: list[NestedKey] = list(batch.keys(True, True))
        loss: Tensor = self._graph(*(batch.get(key) for key in self._keys))
        return loss

    def _learn_from_values(self, *values: Tensor) -> Tensor:
        """Do what `learn_from` says with the values of `_keys`."""
        return self._learn_from(make_batch(dict(zip(self._keys, values, strict=True))))

    def _learn_from(self, batch: TensorDictBase) -> Tensor:
        """Do what `learn_from` says, one operation after the other."""
        loss = self.loss(batch)
        if (penalty := self.method.penalty(self.online_network, batch)) is not None:
            loss = loss + penalty
        return update(loss, *self._learning, self.optimiser, self.learn.tau)

    def freeze(self, layers: int) -> None:
        """Freeze the first `layers` layers, and let the others learn."""
        if layers != self.online_network.frozen:
            super().freeze(layers)
            self.target_network.frozen = self.network.frozen = layers
            self._find_learning()

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs."""
        state, target = super().state_dict(), self.target_network.state_dict()
        # Both networks share the tensors of frozen layers.
        own = {k: v for k, v in target.items() if v.data_ptr() != state[f"online.{k}"].data_ptr()}
        state |= add_prefix("target", own) | add_prefix("replay", self.replay.state_dict())
        return state | {"counters": torch.tensor([self.steps, self.updates])}

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned."""
        super().load_state_dict(state)
        self.steps, self.updates = map(int, state["counters"])
        self.target_network.load_state_dict(strip_prefix("online", state) | strip_prefix("target", state))
        self.replay.load_state_dict(strip_prefix("replay", state))


def build(setup: Setup) -> DoubleDQN:
    """Make double DQN with the settings of `setup.learn`."""
    return DoubleDQN(setup)
