"""The agent: acts epsilon-greedily, and learns by double DQN from replayed transitions."""

from __future__ import annotations

import copy

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor

from ship_trl.config import Learn
from ship_trl.learn.delta import Rows
from ship_trl.learn.glance import Glance
from ship_trl.learn.loss import double_dqn_target, td_loss
from ship_trl.learn.network import CONV_NAMES, DuelingNetwork
from ship_trl.learn.vision import DeltaVision, DenseVision, Draw, computing

# From this many frozen layers on, their output is kept in the replay in place of the state: 3,136
# numbers after the third (in bfloat16 6 kB, a little less than a picture), 200 after the fourth. That
# is far more than a state, but in a fraction of the time that computing it again takes.
KEPT_FROM = 3


def frozen_layers(network: DuelingNetwork) -> int:
    """How many conv layers, counted from the image, are frozen.

    Raises:
        ValueError: a part of a layer is, or one that is not among the first.
    """
    learning = {name for name, p in network.named_parameters() if p.requires_grad}
    whole = {name for name, _ in network.named_parameters()}
    for count in range(len(CONV_NAMES) + 1):
        if learning == {name for name in whole if not name.startswith(CONV_NAMES[:count])}:
            return count
    raise ValueError("only whole conv layers can be frozen, the first ones before the others")


class Agent:
    """Acts and learns.

    It explores by the online network, as the paper does, and is judged by the soft target: the
    running average of the online network over the last 1/tau updates. Actions are often worth
    almost the same (one second at 12 m/s in place of 15 costs 0.7 of a return of 84), so that each
    update turns some of the online network's choices over; their average is steady.

    Args:
        network: its initial weights go to the online and to the target network alike; the first
            conv layers may be frozen (without `requires_grad`), and stay out of the optimiser.
        draw: states to pixels.
        num_actions: A.
        learn: hyperparameters.
        exploration: generator of the epsilon-greedy draws, on the network's device.

    `observes` names what it takes for an observation: `state`, or `features` where so many layers
    are frozen that their output is kept in place of the state; `encode` makes the one of the other.
    """

    def __init__(
        self,
        network: DuelingNetwork,
        draw: Draw,
        num_actions: int,
        learn: Learn,
        exploration: Generator,
    ) -> None:
        self.network, self.draw, self.learn = network, draw, learn
        self.exploration = exploration
        self.num_actions = num_actions
        self.average = copy.deepcopy(network).requires_grad_(False)
        self.frozen = frozen_layers(network)
        device = network.conv1.weight.device
        on_cpu = device.type == "cpu"
        self.observes = "features" if on_cpu and self.frozen >= KEPT_FROM else "state"
        self.vision = (DeltaVision if on_cpu else DenseVision)(draw, computing(learn.precision, device))
        self._online = self.vision.reader(network, self.frozen)
        self._slow = self.vision.reader(self.average, self.frozen)
        self._online.learn()
        self._actor = self.vision.actor(network, self.frozen)
        self.optimiser = torch.optim.Adam(self._online.parameters, lr=learn.lr, fused=True)

    @torch.no_grad()
    def q_values(self, state: Tensor) -> Tensor:
        """Q-values by which the agent is judged, of the averaged network in float32: [N, S] to [N, A]."""
        return self.average(self.draw(state))

    def encode(self, state: Tensor) -> Tensor:
        """What the frozen layers make of states, in the precision that learns: [N, S] to [N, F]."""
        assert isinstance(self._actor, Glance)
        return self._actor.encode(self.draw(state)).to(self.vision.dtype)

    @torch.no_grad()
    def look(self, observation: Tensor) -> object:
        """An observation [N, ...] through the frozen layers, for the networks to read on."""
        if self.observes == "features":
            return Rows(observation, (None,) * (len(CONV_NAMES) - self.frozen))
        return self._online.advance(self.vision.look(observation), self.frozen)

    def act(self, observation: Tensor, epsilon: float) -> Tensor:
        """Epsilon-greedy actions: [N, ...] to int64 [N].

        The same number of random draws is made whatever epsilon is, and pictures are drawn only
        where the network decides.
        """
        count, device = observation.shape[0], observation.device
        explore = torch.rand(count, generator=self.exploration, device=device) < epsilon
        action = torch.randint(self.num_actions, (count,), generator=self.exploration, device=device)
        exploring = sum(explore.tolist())
        if exploring == 0:
            return self._best(observation)
        if exploring < count:
            action[~explore] = self._best(observation[~explore])
        return action

    def _best(self, observation: Tensor) -> Tensor:
        """The online network's choice: [N, ...] to int64 [N]."""
        if self.observes == "features":
            assert isinstance(self._actor, Glance)
            return self._actor.actions_on(observation)
        return self._actor.actions(self.draw(observation))

    def set_learning_rate(self, rate: float) -> None:
        """Use `rate` from the next update on."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate

    def update(self, batch: TensorDictBase) -> Tensor:
        """One gradient step on a batch of the replay, then the soft target; returns the loss."""
        now, later = self.look(batch["observed"]), self.look(batch["later"])
        with torch.no_grad():
            online, slow = self._online.q_values(later), self._slow.q_values(later)
        wanted = double_dqn_target(online, slow, batch["reward"], batch["terminated"], self.learn.gamma)
        loss = td_loss(
            self._online.q_values(now), batch["action"], wanted, self.learn.loss, self.learn.huber_delta
        )
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self._online.hand_back()
        self.optimiser.step()
        with torch.no_grad():
            torch._foreach_lerp_(self._slow.parameters, self._online.parameters, self.learn.tau)
        self._online.refresh()
        self._slow.refresh()
        self._actor.changed()
        return loss.detach()
