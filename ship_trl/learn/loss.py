"""The double-DQN loss: equations 1 and 2, but the online network chooses the next action (van Hasselt)."""

from __future__ import annotations

import copy
from typing import Any

import torch
import torch.nn.functional as F
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import dispatch
from torch import Tensor
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from ship_trl.config.types import Loss

# Key of the number of steps whose rewards a transition sums, [B, 1]; one without it.
STEPS = "steps_to_next_obs"


def double_dqn_target(
    next_q: Tensor, next_target_q: Tensor, reward: Tensor, terminated: Tensor, gamma: float | Tensor
) -> Tensor:
    """Return TD targets [..., 1]: the online network chooses the next action, the target network rates it.

    Shapes: Q-values of the next state by both networks [..., A]; reward, terminated and gamma [..., 1].
    """
    value = next_target_q.gather(-1, next_q.argmax(-1, keepdim=True))
    # A truncated step is not terminated, so it bootstraps.
    return reward + gamma * value * ~terminated


def td_loss(q: Tensor, td_target: Tensor, kind: Loss, huber_delta: float = 1.0) -> Tensor:
    """Compute the mean loss of Q-values [B, 1] against their TD targets [B, 1].

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


def mark_loaded(loss: DQNLoss, *_: Any) -> None:
    """Mark the weights of a loss as changed: TorchRL loads them by `data`, which has no version."""
    torch.autograd.graph.increment_version(list(loss.parameters()))


class DoubleDQNLoss(DQNLoss):
    """TorchRL's `DQNLoss` for double DQN, with a Huber threshold and several times less overhead.

    Keys, target parameters and updaters are the same as in `DQNLoss`. The networks are called directly, not
    through the actor. Actions are indices [B]. Priority weights, masks, reductions and value estimators
    other than TD(0) are not supported.

    Args:
        value_network: Q-value actor around a network that maps observations to Q-values [..., A].
        kind: formula of the loss, see `td_loss`.
        huber_delta: Huber threshold, in scaled rewards.
        gamma: discount per step.
        write_td_error: whether to write `td_error` into the transitions; uniform replay does not need it.
    """

    def __init__(
        self,
        value_network: QValueActor,
        *,
        kind: Loss = Loss.l2,
        huber_delta: float = 1.0,
        gamma: float,
        write_td_error: bool = True,
    ) -> None:
        super().__init__(
            value_network,
            # Unused: `td_loss` computes the loss.
            loss_function="l2",
            double_dqn=True,
            action_space="categorical",
        )
        self.kind, self.huber_delta, self.gamma = kind, huber_delta, gamma
        self.write_td_error = write_td_error
        self.make_value_estimator(gamma=gamma)
        network = value_network[0].module
        # Not registered as modules: the loss holds their parameters already.
        target = copy.deepcopy(network).requires_grad_(False)
        self.__dict__.update(network=network, target_network=target)
        self._share_target()
        self.register_load_state_dict_post_hook(mark_loaded)

    def _share_target(self) -> None:
        """Make the target network use the loss's target parameters."""
        # Attribute access would warn until an updater exists.
        params: Any = dict(self.named_children())["target_value_network_params"]
        params["module", "0", "module"].to_module(self.target_network)
        for name, layer in self.network.named_children():
            if not any(parameter.requires_grad for parameter in layer.parameters()):
                # Share frozen layers, so that a backend can reuse their activations.
                setattr(self.target_network, name, layer)

    def _apply(self, fn: Any, recurse: bool = True) -> Any:
        """Move or cast the loss and its target network."""
        moved = super()._apply(fn)
        if "target_network" in self.__dict__:
            self._share_target()
        return moved

    def __deepcopy__(self, memo: Any) -> Any:
        """Raise an error: the networks of a copy would not use the copy's parameters."""
        raise TypeError("a DoubleDQNLoss cannot be copied; build a new one around a copy of its network")

    def rebuild(self) -> DoubleDQNLoss:
        """Make this loss anew around its network, after layers were frozen or thawed."""
        actor = QValueActor(self.network, in_keys=self.value_network_in_keys, action_space="categorical")
        return type(self)(
            actor,
            kind=self.kind,
            huber_delta=self.huber_delta,
            gamma=float(self.gamma),
            write_td_error=self.write_td_error,
        )

    @dispatch
    def forward(self, tensordict: TensorDictBase) -> TensorDict:
        """Compute the loss of transitions [B], of one step or of `steps_to_next_obs` [B, 1].

        If `write_td_error`, write the squared `td_error` [B, 1].
        """
        keys, (observation,) = self.tensor_keys, self.value_network_in_keys
        following = tensordict.get("next")
        with torch.no_grad():
            next_observation = following.get(observation)
            gamma = self.gamma if (steps := tensordict.get(STEPS, None)) is None else self.gamma**steps
            td_target = double_dqn_target(
                self.network(next_observation),
                self.target_network(next_observation),
                following.get(keys.reward),
                following.get(keys.terminated),
                gamma,
            )
        action = tensordict.get(keys.action).unsqueeze(-1)
        q = self.network(tensordict.get(observation)).gather(-1, action)
        if self.write_td_error:
            tensordict.set(keys.priority, (q.detach() - td_target).square())
        return TensorDict({"loss": td_loss(q, td_target, self.kind, self.huber_delta)})


class ForeachSoftUpdate(SoftUpdate):
    """TorchRL's `SoftUpdate`, as one foreach operation over all parameters."""

    def __init__(self, loss_module: DoubleDQNLoss, *, tau: float) -> None:
        super().__init__(loss_module, tau=tau)
        self._find_parameters()

    def _find_parameters(self) -> None:
        """Look up the memory of the parameters; moving or casting the loss changes it."""
        names = list(self._sources.keys(True, True))
        self._first = names[0]
        self._online = [self._sources[name].data for name in names]
        self._target = [self._targets[target_key(name)].data for name in names]

    def step(self) -> None:
        """Move the target parameters towards the online ones by the fraction `tau`."""
        if self._online[0].data_ptr() != self._sources[self._first].data_ptr():
            self._find_parameters()
        tau = 1.0 - self.eps
        torch._foreach_lerp_(self._target, self._online, tau)


def target_key(name: Any) -> Any:
    """Return the key of the target parameter for an online one."""
    return (f"target_{name[0]}", *name[1:]) if isinstance(name, tuple) else f"target_{name}"
