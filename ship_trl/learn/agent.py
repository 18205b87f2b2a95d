"""The agent: double DQN on replayed transitions, with an exploring and a greedy policy."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import torch
from tensordict import TensorDictBase
from torch import Generator, Tensor
from torchrl.modules import QValueActor

from ship_trl.config.types import BackendName, Learn
from ship_trl.learn.backend import Draw, choose_backend, choose_dtype
from ship_trl.learn.fast.incremental import Incremental
from ship_trl.learn.fast.inference import CachedInference
from ship_trl.learn.fast.weights_version import count_untracked_write
from ship_trl.learn.loss import DoubleDQNLoss, ForeachSoftUpdate
from ship_trl.learn.network import Dense, DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam
from ship_trl.learn.policy import EpsilonGreedy, greedy_policy
from ship_trl.learn.replay import DrawPixels, StateReplay


class Agent:
    """Networks, loss, target updater, optimiser and policies of double DQN.

    The online network explores, as in the paper. Evaluations use the target network, which is the running
    average of the online network over the last 1/tau updates. Q-values of actions are often almost equal
    (one second at 12 m/s instead of 15 costs 0.7 of a return of 84). So each update changes some choices
    of the online network, but few of the average.

    Args:
        network: initial weights of both the online and the target network.
        draw: maps states to pixels.
        num_actions: A.
        learn: hyperparameters.
        exploration: random generator of the exploring policy, on the network's device.
        frozen: number of conv layers, counted from the image, that never learn.

    Attributes:
        observation: key that the agent reads: `features` if the replay stores what `encode` returns, else
            `state`.
        policy: explores.
        greedy: takes the best action.
        backend: name of the backend that computes the conv layers.
        dtype: precision of the conv layers.
        feature_dtype: half precision of stored features.
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
        self.dtype = choose_dtype(learn.precision, device)
        network.backend = choose_backend(learn.backend, draw, self.dtype, device, network.geometry)
        incremental = isinstance(network.backend, Incremental)
        self.backend = BackendName.incremental if incremental else BackendName.dense
        # If only linear layers learn, the replay also stores features of the frozen layers: slow to compute,
        # quick to read. In the paper's network they are 3,136 numbers after the third layer (6 kB in half
        # precision, a little less than a frame), and 200 after the fourth.
        stores_features = incremental and self.frozen >= network.linear_from
        self.observation = "features" if stores_features else "state"
        # float16 has three more bits of mantissa than bfloat16, so it is better for float32 results.
        self.feature_dtype = torch.bfloat16 if self.dtype is torch.bfloat16 else torch.float16
        network_input = "pixels" if self.observation == "state" else self.observation
        actor = QValueActor(network, in_keys=[network_input], action_space="categorical")
        self.loss = DoubleDQNLoss(
            actor, kind=learn.loss, huber_delta=learn.huber_delta, gamma=learn.gamma, write_td_error=False
        )
        # Evaluations compute whole frames in float32.
        self.target_network = copy.copy(self.loss.target_network)
        self.target_network.backend = Dense()
        self.target_update = ForeachSoftUpdate(self.loss, tau=learn.tau)
        learning = [parameter for parameter in network.parameters() if parameter.requires_grad]
        self.optimiser = ChannelsLastAdam(learning, lr=learn.lr)
        self._inference = CachedInference(network, draw.background, self.frozen) if incremental else None
        self.policy = EpsilonGreedy(self._best_actions, self.observation, num_actions, exploration)
        self.greedy = greedy_policy(self.target_network, draw)

    def encode(self, state: Tensor) -> Tensor:
        """Encode states with the frozen layers: [N, S] to [N, K] in half precision."""
        assert self._inference is not None
        # One by one, so that the bits do not depend on the batch: a resumed run recomputes the features.
        features = torch.cat([self._inference.encode(self.draw(one)) for one in state.split(1)])
        # float16 would store values above 65,504 as infinity. After ReLU no value is negative.
        return features.clamp_(max=torch.finfo(self.feature_dtype).max).to(self.feature_dtype)

    @torch.no_grad()
    def _best_actions(self, observation: Tensor) -> Tensor:
        """Return the online network's best actions: observations [N, ...] to int64 [N]."""
        if self._inference is None:
            return self.network(self.draw(observation)).argmax(-1)
        if self.observation == "features":
            return self._inference.actions_from_features(observation)
        return self._inference.actions(self.draw(observation))

    def set_learning_rate(self, rate: float) -> None:
        """Set the learning rate of the next updates."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate

    def replay(self, learn: Learn, generator: Generator, device: torch.device) -> StateReplay:
        """Make a replay buffer; `update` takes its batches."""
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
        """Take one gradient step on a batch, update the target network, and return the loss."""
        loss = self.loss(batch)["loss"]
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.target_update.step()
        return loss.detach()

    def state_dict(self) -> dict[str, Tensor]:
        """Return networks, Adam's averages and the exploration generator; tensors are not copied."""
        online, target = self.network.state_dict(), self.target_network.state_dict()
        state = {f"online.{key}": value for key, value in online.items()}
        # Both networks share the tensors of frozen layers.
        own = {key: value for key, value in target.items() if value.data_ptr() != online[key].data_ptr()}
        state |= {f"target.{key}": value for key, value in own.items()}
        for name, parameter in self.network.named_parameters():
            for key, value in self.optimiser.state.get(parameter, {}).items():
                state[f"adam.{name}.{key}"] = value
        return state | {"exploration": self.policy.generator.get_state()}

    @torch.no_grad()
    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned into the memory of these networks.

        Raises:
            KeyError, RuntimeError: the state does not fit this agent.
        """
        for name, network in (("online", self.network), ("target", self.target_network)):
            for key, value in network.state_dict().items():
                value.copy_(state.get(f"{name}.{key}", state[f"online.{key}"]))
        # Makes caches of weights stale.
        count_untracked_write()
        for name, parameter in self.network.named_parameters():
            if f"adam.{name}.step" in state:
                for key, value in self.optimiser.init_state(parameter).items():
                    value.copy_(state[f"adam.{name}.{key}"])
        self.policy.generator.set_state(state["exploration"].cpu())
