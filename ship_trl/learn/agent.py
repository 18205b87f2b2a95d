"""The agent: Q-network, double-DQN loss, optimiser and soft target, as TorchRL parts."""

from __future__ import annotations

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

    @torch.no_grad()
    def q_values(self, state: Tensor) -> Tensor:
        """Q-values of the online network: [N, S] to [N, A]."""
        return self.network(self.draw(state))

    def greedy(self, state: Tensor) -> Tensor:
        """The best action by the online network: [N, S] to int64 [N]."""
        return self.q_values(state).argmax(-1)

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
            action[rows] = self.greedy(state[rows])
        return action

    def update(self, batch: TensorDictBase) -> Tensor:
        """One gradient step on a batch with pixels, then the soft target; returns the loss."""
        loss = self.loss_module(batch)["loss"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.target.step()
        return loss.detach()
