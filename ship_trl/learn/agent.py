"""The agent: Q-network, double-DQN loss, optimiser and soft target, as TorchRL parts."""

from __future__ import annotations

import copy

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor
from torchrl.data import Categorical
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from ship_trl.config import Learn
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.replay import Draw


class Agent:
    """Acts epsilon-greedily and learns from batches.

    It explores by the online network, as the paper does, and is judged by the soft target: the
    running average of the online network over the last 1/tau updates. Actions are often worth
    almost the same (one second at 12 m/s in place of 15 costs 0.7 of a return of 84), so that each
    update turns some of the online network's choices over; their average is steady.

    Args:
        network: its initial weights go to the online and to the target network alike; parameters
            without `requires_grad` are frozen and stay out of the optimiser.
        draw: states to pixels.
        num_actions: A.
        learn: hyperparameters.
        exploration: generator of the epsilon-greedy draws, on the network's device.
    """

    def __init__(
        self,
        network: DuelingNetwork,
        draw: Draw,
        num_actions: int,
        learn: Learn,
        exploration: Generator,
    ) -> None:
        self.network, self.draw = network, draw
        self.exploration = exploration
        self.num_actions = num_actions
        actor = QValueActor(network, in_keys=["pixels"], spec=Categorical(num_actions))
        self.loss_module = DQNLoss(actor, delay_value=True, double_dqn=True, loss_function=learn.loss.name)
        self.loss_module.make_value_estimator(gamma=learn.gamma)
        trained = [p for p in network.parameters() if p.requires_grad]
        self.optimiser = torch.optim.Adam(trained, lr=learn.lr, fused=True)
        self.target = SoftUpdate(self.loss_module, tau=learn.tau)
        self.average = self._view_of_target()

    def _view_of_target(self) -> DuelingNetwork:
        """The target as a network: it shares the memory that the soft update writes to."""
        view = copy.deepcopy(self.network).requires_grad_(False)
        slow = self.loss_module.target_value_network_params.flatten_keys(".")
        for name, parameter in view.named_parameters():
            (key,) = (key for key in slow.keys() if key.endswith(f".{name}"))  # noqa: SIM118
            parameter.data = slow[key].data
        return view

    @torch.no_grad()
    def q_values(self, state: Tensor) -> Tensor:
        """Q-values by which the agent is judged, of the averaged network: [N, S] to [N, A]."""
        return self.average(self.draw(state))

    def act(self, state: Tensor, epsilon: float) -> Tensor:
        """Epsilon-greedy actions: [N, S] to int64 [N].

        The same number of random draws is made whatever epsilon is, and pictures are drawn only
        where the network decides.
        """
        count, device = state.shape[0], state.device
        explore = torch.rand(count, generator=self.exploration, device=device) < epsilon
        action = torch.randint(self.num_actions, (count,), generator=self.exploration, device=device)
        rows = (~explore).nonzero().squeeze(-1)
        if rows.numel():
            with torch.no_grad():
                action[rows] = self.network(self.draw(state[rows])).argmax(-1)
        return action

    def set_learning_rate(self, rate: float) -> None:
        """Use `rate` from the next update on."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate

    def update(self, batch: TensorDictBase) -> Tensor:
        """One gradient step on a batch with pixels, then the soft target; returns the loss."""
        loss = self.loss_module(batch)["loss"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.target.step()
        return loss.detach()
