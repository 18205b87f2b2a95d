"""The double-DQN loss (equations 1 and 2, with van Hasselt's choice of the action)."""

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
from ship_trl.learn.fast.changes import count_rewrite, rewrites


def td_loss(q: Tensor, td_target: Tensor, kind: Loss, huber_delta: float = 1.0) -> Tensor:
    """Compute the mean loss of Q-values [B, 1] against their targets [B, 1].

    `l2` is the squared error (equation 2). Huber's is half the square of errors below `huber_delta`, in
    scaled rewards, and grows in proportion to them above.

    Raises:
        ValueError: a kind without a formula.
    """
    if kind is Loss.l2:
        return F.mse_loss(q, td_target)
    if kind is Loss.huber:
        return F.huber_loss(q, td_target, delta=huber_delta)
    raise ValueError(f"learn.loss: no formula for {kind.name} in td_loss")


class DoubleDQNLoss(DQNLoss):
    """TorchRL's `DQNLoss` for double DQN, with Huber's threshold and several times less overhead.

    Keys, target parameters and updaters are those of `DQNLoss`; the networks are called by themselves,
    without choosing actions, and read the next observations one after the other. Actions are indices [B];
    priority weights, masks, reductions and other value estimators than one step's are not for it.

    Args:
        value_network: a Q-value actor around a network that maps observations to Q-values [..., A].
        kind: squared or Huber's.
        huber_delta: Huber's threshold, in scaled rewards.
        gamma: discount of a step.
        write_td_error: whether transitions are given their `td_error`, which uniform replay has no use for.
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
            # Not used: `td_loss` is.
            loss_function="l2",
            double_dqn=True,
            action_space="categorical",
        )
        self.kind, self.huber_delta, self.gamma = kind, huber_delta, gamma
        self.write_td_error = write_td_error
        self.make_value_estimator(gamma=gamma)
        network = value_network[0].module
        # Not registered: they are other views of parameters that the loss holds already.
        target = copy.deepcopy(network).requires_grad_(False)
        self.__dict__.update(network=network, target_network=target)
        self._share_target()
        self.register_load_state_dict_post_hook(count_rewrite)

    def _share_target(self) -> None:
        """Let the target network compute with the loss's target parameters."""
        # As an attribute they would be complained of until an updater is made.
        params: Any = dict(self.named_children())["target_value_network_params"]
        params["module", "0", "module"].to_module(self.target_network)
        for name, layer in self.network.named_children():
            if not any(parameter.requires_grad for parameter in layer.parameters()):
                # What never learns is the same in both, and may so be computed once for both.
                setattr(self.target_network, name, layer)

    def _apply(self, fn: Any, recurse: bool = True) -> Any:
        """Move or cast the loss, and the target network with it."""
        moved = super()._apply(fn)
        if "target_network" in self.__dict__:
            self._share_target()
            count_rewrite()
        return moved

    def __deepcopy__(self, memo: Any) -> Any:
        """Refuse: a copy's networks would not be those of its parameters."""
        raise TypeError("a DoubleDQNLoss cannot be copied; make another one around a copy of its network")

    @dispatch
    def forward(self, tensordict: TensorDictBase) -> TensorDict:
        """Compute the loss of transitions [B]; writes `td_error` [B, 1], squared, into them if asked to.

        A truncated step is not terminated, so it bootstraps.
        """
        keys, (observation,) = self.tensor_keys, self.value_network_in_keys
        following = tensordict.get("next")
        with torch.no_grad():
            later = following.get(observation)
            choice = self.network(later).argmax(-1, keepdim=True)
            value = self.target_network(later).gather(-1, choice)
            ended = following.get(keys.terminated)
            td_target = following.get(keys.reward) + self.gamma * value * ~ended
        action = tensordict.get(keys.action).unsqueeze(-1)
        q = self.network(tensordict.get(observation)).gather(-1, action)
        if self.write_td_error:
            tensordict.set(keys.priority, (q.detach() - td_target).square())
        return TensorDict({"loss": td_loss(q, td_target, self.kind, self.huber_delta)})


class ForeachSoftUpdate(SoftUpdate):
    """TorchRL's `SoftUpdate`, all parameters at once."""

    def __init__(self, loss_module: DoubleDQNLoss, *, tau: float) -> None:
        super().__init__(loss_module, tau=tau)
        self._find()

    def _find(self) -> None:
        """Look up where the parameters lie, which a move or a cast of the loss changes."""
        names = list(self._sources.keys(True, True))
        self._online = [self._sources[name].data for name in names]
        self._slow = [self._targets[rename(name)].data for name in names]
        self._rewrites = rewrites()

    def step(self) -> None:
        """Move the target parameters by `tau` of the way to the online ones."""
        if self._rewrites != rewrites():
            self._find()
        tau = 1.0 - self.eps
        torch._foreach_lerp_(self._slow, self._online, tau)


def rename(name: Any) -> Any:
    """Name of the target of a source."""
    return (f"target_{name[0]}", *name[1:]) if isinstance(name, tuple) else f"target_{name}"
