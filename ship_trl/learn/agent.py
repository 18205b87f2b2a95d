"""The agent: acts epsilon-greedily, and learns by double DQN from replayed transitions."""

from __future__ import annotations

import copy

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor
from torchrl.modules import QValueActor

from ship_trl.config import Learn
from ship_trl.learn.delta import Incremental
from ship_trl.learn.glance import Glance
from ship_trl.learn.loss import DoubleDQNLoss, ForeachSoftUpdate
from ship_trl.learn.network import CONV_NAMES, Dense, DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam
from ship_trl.learn.vision import Draw, choose_backend, computing

# From this many frozen layers on, their output is kept in the replay in place of the state: 3,136
# numbers after the third (in half precision 6 kB, a little less than a picture), 200 after the fourth.
# That is far more than a state, but in a fraction of the time that computing it again takes.
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
    `kept` is the precision in which features are kept, of two bytes on every machine.
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
        self.frozen = network.frozen = frozen_layers(network)
        device = network.conv1.weight.device
        network.backend = choose_backend(draw, learn.precision, device)
        incremental = isinstance(network.backend, Incremental)
        self.observes = "features" if incremental and self.frozen >= KEPT_FROM else "state"
        self.dtype = computing(learn.precision, device)
        # Where float32 computes, float16 keeps three bits more of it than bfloat16 would.
        self.kept = torch.bfloat16 if self.dtype is torch.bfloat16 else torch.float16
        reads = "pixels" if self.observes == "state" else self.observes
        actor = QValueActor(network, in_keys=[reads], action_space="categorical")
        self.loss = DoubleDQNLoss(
            actor, kind=learn.loss, huber_delta=learn.huber_delta, gamma=learn.gamma, write_td_error=False
        )
        self.average = copy.copy(self.loss.target_network)
        self.average.backend = Dense()
        self.target_update = ForeachSoftUpdate(self.loss, tau=learn.tau)
        self._actor = Glance(network, draw.still, self.frozen) if incremental else None
        learning = [parameter for parameter in network.parameters() if parameter.requires_grad]
        self.optimiser = ChannelsLastAdam(learning, lr=learn.lr)

    @torch.no_grad()
    def q_values(self, state: Tensor) -> Tensor:
        """Q-values by which the agent is judged, of the averaged network in float32: [N, S] to [N, A]."""
        return self.average(self.draw(state))

    def encode(self, state: Tensor) -> Tensor:
        """What the frozen layers make of states, to be kept: [N, S] to [N, F] in half precision."""
        assert isinstance(self._actor, Glance)
        features = self._actor.encode(self.draw(state))
        # float16 ends at 65,504, and would keep what is beyond as infinite; nothing is negative.
        return features.clamp_(max=torch.finfo(self.kept).max).to(self.kept)

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

    @torch.no_grad()
    def _best(self, observation: Tensor) -> Tensor:
        """The online network's choice: [N, ...] to int64 [N]."""
        if self._actor is None:
            return self.network(self.draw(observation)).argmax(-1)
        if self.observes == "features":
            return self._actor.actions_on(observation)
        return self._actor.actions(self.draw(observation))

    def set_learning_rate(self, rate: float) -> None:
        """Use `rate` from the next update on."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate

    def draw_batch(self, batch: TensorDictBase) -> None:
        """Put `pixels` beside the states of transitions, where it is states that are kept."""
        if self.observes == "state":
            batch["pixels"] = self.draw(batch["state"])
            batch["next", "pixels"] = self.draw(batch["next", "state"])

    def update(self, batch: TensorDictBase) -> Tensor:
        """One gradient step on a batch of the replay, then the soft target; returns the loss."""
        self.draw_batch(batch)
        loss = self.loss(batch)["loss"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.target_update.step()
        return loss.detach()
