"""Double Q-learning (equations 1 and 2; van Hasselt) as functions, for one agent or K stacked ones.

Shapes: [..., B] is [B] for one agent and [K, B] for stacked ones. `DoubleDQNLoss` is the same for TorchRL.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
import torch.nn.functional as F
from tensordict import NestedKey, TensorDict, TensorDictBase
from tensordict.nn import dispatch
from torch import Tensor
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss

from ship_trl.config.types import Loss
from ship_trl.learn.masks import mask_of, mask_values

# Key of the number of steps whose rewards a transition sums, [B, 1]; one without it.
STEPS = "steps_to_next_obs"
# Q-values [..., B, A] of observations.
Q = Callable[[Tensor], Tensor]


class Batch(NamedTuple):
    """Transitions [..., B]: what was observed and done, int64 [..., B], and what followed.

    `reward` is the sum of the rewards until `following` is observed, `terminated` whether the episode had
    ended then, `discount` that of a value there; these are [..., B, 1], and `discount` may be a number.
    `allowed` are the actions allowed there, bool [..., B, A]; None for all.
    """

    observation: Tensor
    action: Tensor
    reward: Tensor
    following: Tensor
    terminated: Tensor
    discount: float | Tensor
    allowed: Tensor | None = None


def read_batch(
    transitions: TensorDictBase, observation: NestedKey, gamma: float, keys: Any = DQNLoss.default_keys
) -> Batch:
    """Read transitions [B], of one step or of `steps_to_next_obs` [B, 1], by TorchRL's keys."""
    following, steps = transitions.get("next"), transitions.get(STEPS, None)
    return Batch(
        transitions.get(observation),
        transitions.get(keys.action),
        following.get(keys.reward),
        following.get(observation),
        following.get(keys.terminated),
        gamma if steps is None else gamma**steps,
        mask_of(following),
    )


def td_target(
    next_q: Tensor, next_target_q: Tensor, reward: Tensor, terminated: Tensor, discount: float | Tensor
) -> Tensor:
    """Return TD targets [..., 1]: the online network chooses the next action, the target network rates it.

    Shapes: Q-values of the next state by both networks [..., A]; reward, terminated and discount [..., 1].
    """
    value = next_target_q.gather(-1, next_q.argmax(-1, keepdim=True))
    # A truncated step is not terminated, so it bootstraps.
    return reward + discount * value * ~terminated


def td_loss(q: Tensor, td_target: Tensor, kind: Loss, huber_delta: float = 1.0) -> Tensor:
    """Compute the mean loss of Q-values [..., 1] against their TD targets [..., 1].

    `l2` is the squared error (equation 2). `huber` is half the squared error below `huber_delta`, and linear
    above.

    Raises:
        ValueError: an unknown kind of loss.
    """
    if kind is Loss.l2:
        return F.mse_loss(q, td_target)
    if kind is Loss.huber:
        return F.huber_loss(q, td_target, delta=huber_delta)
    raise ValueError(f"learn.loss: no formula for {kind.name} in td_loss")


def double_dqn_loss(
    online: Q, target: Q, batch: Batch, kind: Loss, huber_delta: float = 1.0
) -> tuple[Tensor, Tensor]:
    """Return the mean loss of a batch, and the errors of its Q-values [..., B, 1] without gradients."""
    with torch.no_grad():
        both = mask_values(online(batch.following), batch.allowed), target(batch.following)
        wanted = td_target(*both, batch.reward, batch.terminated, batch.discount)
    q = online(batch.observation).gather(-1, batch.action.unsqueeze(-1))
    return td_loss(q, wanted, kind, huber_delta), q.detach() - wanted


def sum_rewards(
    n: int,
    gamma: float,
    first: Tensor,
    read: Callable[[Tensor], tuple[Tensor, Tensor]],
    follow: Callable[[Tensor], tuple[Tensor, Tensor]],
) -> tuple[Tensor, Tensor, Tensor]:
    """Sum up to `n` rewards before a target bootstraps (Sutton 1988), to the end of the episode at most.

    As in Rainbow (Hessel et al., 2018), actions between are not corrected for.

    Args:
        n: how many at most.
        gamma: discount per step.
        first: indices of steps, int64 [..., B].
        read: returns rewards and whether the episode ends, of the steps with such indices.
        follow: returns the indices of the next steps, and whether these are stored already: if not, the
            target bootstraps earlier.

    Returns:
        The discounted sums, the indices of the last steps, and the numbers of steps, each [..., B].
    """
    reward, ends = read(first)
    last, count, goes_on = first, torch.ones_like(first), ~ends
    for step in range(1, n):
        following, is_stored = follow(last)
        goes_on = goes_on & is_stored
        last = torch.where(goes_on, following, last)
        later, ends = read(last)
        reward = reward + gamma**step * later * goes_on
        count, goes_on = count + goes_on, goes_on & ~ends
    return reward, last, count


def update(
    loss: Tensor,
    online: list[Tensor],
    target: list[Tensor],
    optimiser: torch.optim.Optimizer,
    tau: float,
) -> Tensor:
    """Take a gradient step, and move the target parameters towards the online ones by the fraction `tau`.

    Return the loss.
    """
    optimiser.zero_grad(set_to_none=True)
    loss.backward()
    optimiser.step()
    with torch.no_grad():
        torch._foreach_lerp_(target, online, tau)
    return loss.detach()


class DoubleDQNLoss(DQNLoss):
    """TorchRL's `DQNLoss` for double DQN by the functions of this file, with a Huber threshold.

    Keys, target parameters and updaters are those of `DQNLoss`. The networks are called directly, not
    through the actor. Actions are indices [B]. The next action is one that ("next", "action_mask") allows, if
    there is this key. Priority weights, reductions and value estimators other than TD(0) are not supported.

    Args:
        value_network: Q-value actor around a network that maps observations to Q-values [..., A].
        kind: formula of the loss, see `td_loss`.
        huber_delta: Huber threshold, in scaled rewards.
        gamma: discount per step.
    """

    def __init__(
        self, value_network: QValueActor, *, kind: Loss = Loss.l2, huber_delta: float = 1.0, gamma: float
    ) -> None:
        # TorchRL's formula is unused.
        super().__init__(value_network, loss_function="l2", double_dqn=True, action_space="categorical")
        self.kind, self.huber_delta, self.gamma = kind, huber_delta, gamma
        self.make_value_estimator(gamma=gamma)
        # TorchRL loads weights by `data`, which has no version.
        self.register_load_state_dict_post_hook(
            lambda loss, _: torch.autograd.graph.increment_version(list(loss.parameters()))
        )

    def network(self, observation: Tensor) -> Tensor:
        """Compute the Q-values of the network that learns."""
        return self._q_values(self.value_network_params, observation)

    def target_network(self, observation: Tensor) -> Tensor:
        """Compute the Q-values of the target network, without gradients for its weights."""
        return self._q_values(self.target_value_network_params, observation)

    def _q_values(self, parameters: TensorDictBase, observation: Tensor) -> Tensor:
        with parameters.to_module(self.value_network):
            return self.value_network[0].module(observation)

    @dispatch
    def forward(self, tensordict: TensorDictBase) -> TensorDict:
        """Compute the loss of transitions [B], as `read_batch`; write the squared `td_error` [B, 1]."""
        (observation,) = self.value_network_in_keys
        batch = read_batch(tensordict, observation, self.gamma, self.tensor_keys)
        loss, error = double_dqn_loss(self.network, self.target_network, batch, self.kind, self.huber_delta)
        tensordict.set(self.tensor_keys.priority, error.square())
        return TensorDict({"loss": loss})
