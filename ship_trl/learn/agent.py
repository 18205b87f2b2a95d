"""The agent: learns by double DQN from replayed transitions, and provides its policies."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor
from torchrl.modules import QValueActor

from ship_trl.config.types import BackendName, Learn
from ship_trl.learn.backend import Draw, choose_backend, computing
from ship_trl.learn.fast.changes import count_rewrite
from ship_trl.learn.fast.incremental import Incremental
from ship_trl.learn.fast.inference import CachedInference
from ship_trl.learn.loss import DoubleDQNLoss, ForeachSoftUpdate
from ship_trl.learn.network import Dense, DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam
from ship_trl.learn.policy import EpsilonGreedy, greedy_policy
from ship_trl.learn.replay import DrawPixels, StateReplay


class Agent:
    """Networks, loss, target updater, optimiser and policies of double DQN.

    The online network explores, as in the paper. The target network is evaluated: it is the running
    average of the online network over the last 1/tau updates. Q-values of actions are often almost equal
    (one second at 12 m/s instead of 15 costs 0.7 of a return of 84), so each update changes some choices
    of the online network; the average is stable.

    Args:
        network: initial weights of both the online and the target network.
        draw: maps states to pixels.
        num_actions: A.
        learn: hyperparameters.
        exploration: generator of the exploration, on the network's device.
        frozen: how many conv layers, counted from the image, never learn and stay out of the optimiser.

    `observation` is the key that it reads: `state`, or `features` where so many layers are frozen that the
    replay stores their features instead of the state; `encode` computes them.
    `policy` explores, `greedy` is evaluated. `backend` computes the conv layers. `kept` is the half
    precision in which features are stored.
    """

    def __init__(
        self,
        network: DuelingNetwork,
        draw: Draw,
        num_actions: int,
        learn: Learn,
        exploration: Generator,
        frozen: int = 0,
    ) -> None:
        self.network, self.draw, self.frozen = network, draw, frozen
        network.freeze(frozen)
        device = network.shared.weight.device
        self.dtype = computing(learn.precision, device)
        network.backend = choose_backend(learn.backend, draw, self.dtype, device, network.geometry)
        incremental = isinstance(network.backend, Incremental)
        self.backend = BackendName.incremental if incremental else BackendName.dense
        # Once only linear layers learn, the replay stores features of the frozen layers instead of states:
        # in the paper's network 3,136 numbers after the third layer (6 kB in half precision, a little less
        # than a frame), 200 after the fourth. That is far more than a state, but reading it takes a fraction
        # of the time of computing it again.
        keeping = incremental and self.frozen >= network.linear_from
        self.observation = "features" if keeping else "state"
        # Of a float32 result, float16 keeps three bits more than bfloat16.
        self.kept = torch.bfloat16 if self.dtype is torch.bfloat16 else torch.float16
        learned_from = "pixels" if self.observation == "state" else self.observation
        actor = QValueActor(network, in_keys=[learned_from], action_space="categorical")
        self.loss = DoubleDQNLoss(
            actor, kind=learn.loss, huber_delta=learn.huber_delta, gamma=learn.gamma, write_td_error=False
        )
        # Evaluated in float32, on whole frames.
        self.target_network = copy.copy(self.loss.target_network)
        self.target_network.backend = Dense()
        self.target_update = ForeachSoftUpdate(self.loss, tau=learn.tau)
        learning = [parameter for parameter in network.parameters() if parameter.requires_grad]
        self.optimiser = ChannelsLastAdam(learning, lr=learn.lr)
        self._few = CachedInference(network, draw.background, self.frozen) if incremental else None
        self.policy = EpsilonGreedy(self._best, self.observation, num_actions, exploration)
        self.greedy = greedy_policy(self.target_network, draw)

    def encode(self, state: Tensor) -> Tensor:
        """Encode states with the frozen layers: [N, S] to [N, K] in half precision.

        States are encoded one by one, so that the bits depend on the state alone, not on the batch: a replay
        that is loaded from a checkpoint recomputes them.
        """
        assert self._few is not None
        features = torch.cat([self._few.encode(self.draw(one)) for one in state.split(1)])
        # float16 ends at 65,504 and would store larger values as infinity; nothing is negative.
        return features.clamp_(max=torch.finfo(self.kept).max).to(self.kept)

    @torch.no_grad()
    def _best(self, observation: Tensor) -> Tensor:
        """Return the online network's best actions: observations [N, ...] to int64 [N]."""
        if self._few is None:
            return self.network(self.draw(observation)).argmax(-1)
        if self.observation == "features":
            return self._few.actions_on(observation)
        return self._few.actions(self.draw(observation))

    def set_learning_rate(self, rate: float) -> None:
        """Set the learning rate of the next updates."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate

    def replay(self, learn: Learn, generator: Generator, device: torch.device) -> StateReplay:
        """Make the replay buffer whose batches `update` takes."""
        return StateReplay(
            learn.replay_size,
            learn.reward_scale,
            generator,
            device,
            self.observation,
            DrawPixels(self.draw) if self.observation == "state" else None,
            encode=None if self.observation == "state" else self.encode,
        )

    def update(self, batch: TensorDictBase) -> Tensor:
        """Take one gradient step on a batch, then update the target network; returns the loss."""
        loss = self.loss(batch)["loss"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.target_update.step()
        return loss.detach()

    def state_dict(self) -> dict[str, Tensor]:
        """Return networks, Adam's averages and the state of the exploration's generator.

        The tensors of networks and Adam are not copies.
        """
        online, target = self.network.state_dict(), self.target_network.state_dict()
        found = {f"online.{key}": value for key, value in online.items()}
        # Both networks share the tensors of frozen layers.
        own = {key: value for key, value in target.items() if value.data_ptr() != online[key].data_ptr()}
        found |= {f"target.{key}": value for key, value in own.items()}
        for name, parameter in self.network.named_parameters():
            for key, value in self.optimiser.state.get(parameter, {}).items():
                found[f"adam.{name}.{key}"] = value
        return found | {"exploration": self.policy.generator.get_state()}

    @torch.no_grad()
    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned into the memory of these networks.

        Raises:
            KeyError, RuntimeError: the state is of another agent.
        """
        for name, network in (("online", self.network), ("target", self.target_network)):
            for key, value in network.state_dict().items():
                saved = state.get(f"{name}.{key}", state[f"online.{key}"])
                value.copy_(saved)
        # Caches of weights become stale.
        count_rewrite()
        for name, parameter in self.network.named_parameters():
            if f"adam.{name}.step" in state:
                for key, value in self.optimiser.begin(parameter).items():
                    value.copy_(state[f"adam.{name}.{key}"])
        self.policy.generator.set_state(state["exploration"].cpu())
