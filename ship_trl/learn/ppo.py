"""Proximal policy optimisation (Schulman et al., 2017), by TorchRL's `ClipPPOLoss` and `GAE`.

Actor and critic are the two streams of the dueling network. Its outputs are value + advantage - mean of the
advantages: their softmax is that of the advantages, and their mean is the value. So one forward pass gives
both, and the greedy action, the files and the transfer of layers are the same as with Q-values.

With `imitation_coeff` it also imitates the best episode from each start.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torch.distributions import Categorical
from torchrl.modules import MaskedCategorical, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from ship_trl.learn import settings as settings_of
from ship_trl.learn.algorithm import Algorithm, DivergedError, Setup, add_prefix, strip_prefix
from ship_trl.learn.masks import ACTION_MASK, mask_of, mask_values
from ship_trl.learn.optimiser import learning_parameters

# Outputs of the network that acted, [N, A].
OUTPUT = "action_value"
# What is kept of each step; the mask if there is one.
KEPT = "state", "action", ACTION_MASK


def state_value(output: Tensor) -> Tensor:
    """Return the critic's values [..., 1] from the network's outputs [..., A]."""
    return output.mean(-1, keepdim=True)


def make_loss(settings: settings_of.PPO, is_masked: bool = False) -> ClipPPOLoss:
    """Make the loss of batches that hold the network's outputs, and `action_mask` if `is_masked`.

    It has no parameters of its own.
    """
    outputs: list[NestedKey] = [OUTPUT]
    actor = ProbabilisticActor(
        TensorDictModule(nn.Identity(), in_keys=outputs, out_keys=["logits"]),
        in_keys={"logits": "logits", "mask": ACTION_MASK} if is_masked else ["logits"],
        distribution_class=MaskedCategorical if is_masked else Categorical,
        return_log_prob=True,
    )
    return ClipPPOLoss(
        actor,
        TensorDictModule(state_value, in_keys=outputs, out_keys=["state_value"]),
        clip_epsilon=settings.clip_epsilon,
        entropy_coeff=settings.entropy_coeff,
        critic_coeff=settings.critic_coeff,
        loss_critic_type="l2",
        functional=False,
    )


class Best(NamedTuple):
    """Steps of an episode by `KEPT`, [T, ...], and the undiscounted sum of its rewards."""

    steps: TensorDictBase
    episode_return: float


class BestEpisodes:
    """Cuts episodes out of the steps of a batched environment, and keeps the best from each start.

    After self-imitation learning (Oh et al., 2018). That keeps all steps and imitates those whose return is
    above their value; this keeps one whole episode for each start: steps are deterministic here, so the same
    actions from the same start give the same return again. Starts must come again: each new one adds an
    episode to what is kept.
    """

    def __init__(self) -> None:
        self._best: dict[tuple[float, ...], Best] = {}
        # Whose turn it is in `take`.
        self._turn = 0
        # Steps [N] since the oldest running episode began; length and return of each row's episode so far.
        self._steps: list[TensorDictBase] = []
        self._lengths: list[int] = []
        self._returns: list[float] = []

    def __len__(self) -> int:
        return len(self._best)

    def observe(self, step: TensorDictBase) -> None:
        """Take note of a step [N] with the keys of `KEPT`, and below `next` `reward` and `done`."""
        rewards, done = (step["next", key].squeeze(-1).tolist() for key in ("reward", "done"))
        count = len(rewards)
        self._steps.append(step.select(*KEPT, strict=False).clone())
        self._lengths = [length + 1 for length in self._lengths or [0] * count]
        self._returns = [a + b for a, b in zip(self._returns or [0.0] * count, rewards, strict=True)]
        for row in range(count):
            if done[row]:
                self._end(row)
        del self._steps[: len(self._steps) - max(self._lengths)]

    def _end(self, row: int) -> None:
        """Keep the episode of a row if it is the best from its start, and begin another."""
        length, episode_return = self._lengths[row], self._returns[row]
        self._lengths[row], self._returns[row] = 0, 0.0
        start = tuple(self._steps[-length]["state"][row].tolist())
        if start not in self._best or episode_return > self._best[start].episode_return:
            steps = TensorDict.stack([step[row] for step in self._steps[-length:]])
            self._best[start] = Best(steps, episode_return)

    def take(self) -> Best:
        """Return the best episode from one of the starts, each in turn."""
        best = list(self._best.values())[self._turn % len(self._best)]
        self._turn += 1
        return best

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs."""
        best = list(self._best.values())
        lengths = {"lengths": self._lengths, "best_lengths": [len(one.steps) for one in best]}
        returns = {"returns": self._returns, "best_returns": [one.episode_return for one in best]}
        state = {name: torch.tensor(value, dtype=torch.int64) for name, value in lengths.items()}
        state |= {name: torch.tensor(value, dtype=torch.float64) for name, value in returns.items()}
        kept = [step for one in best for step in one.steps.unbind(0)]
        state |= add_prefix("steps", stack(self._steps)) | add_prefix("best", stack(kept))
        return state | {"turn": torch.tensor(self._turn)}

    def load_state_dict(self, state: Mapping[str, Tensor], device: torch.device) -> None:
        """Load what `state_dict` returned."""
        self._lengths, self._returns = state["lengths"].tolist(), state["returns"].tolist()
        self._turn = int(state["turn"])
        self._steps = unstack(strip_prefix("steps", state), device)
        steps, self._best = unstack(strip_prefix("best", state), device), {}
        for length, value in zip(state["best_lengths"].tolist(), state["best_returns"].tolist(), strict=True):
            episode: TensorDictBase = TensorDict.stack(steps[:length])
            self._best[tuple(episode["state"][0].tolist())] = Best(episode, value)
            del steps[:length]


def stack(steps: list[TensorDictBase]) -> dict[str, Tensor]:
    """Return steps as tensors [T, ...] by dotted names; none if there are none."""
    return dict(TensorDict.stack(steps).flatten_keys(".").items()) if steps else {}


def unstack(state: Mapping[str, Tensor], device: torch.device) -> list[TensorDictBase]:
    """Return the steps that `stack` returned."""
    if not state:
        return []
    steps = TensorDict(dict(state), state["action"].shape, device=device).unflatten_keys(".")
    return list(steps.unbind(0))


class PPO(Algorithm):
    """Acts by the actor's probabilities, and learns from each rollout in several passes.

    A rollout is `rollout_steps` steps of all environments. It holds states; pixels are drawn for a minibatch.
    """

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.settings = settings_of.PPO(**{k: v for k, v in setup.options.items() if k != "build"})
        self._shuffle = setup.replay
        self.loss = make_loss(self.settings, self.mask is not None)
        # Advantages are scaled to unit variance over the rollout.
        self.estimate = GAE(
            gamma=self.learn.gamma,
            lmbda=self.settings.gae_lambda,
            value_network=None,
            average_gae=True,
            time_dim=0,
        )
        self._rollout: list[TensorDictBase] = []
        self._output: Tensor | None = None
        self._best = BestEpisodes() if self.settings.imitation_coeff else None
        self._imitates = False

    @torch.no_grad()
    def act(self, step: TensorDictBase, episode: int) -> TensorDictBase:
        """Write `action`, when `episode` training episodes have ended."""
        self.schedule(episode)
        self._imitates = episode >= self.settings.imitation_start * self.learn.episodes
        self._output = check_finite(self.online_network(self.draw(step["state"])))
        chances = mask_values(self._output, mask_of(step)).softmax(-1)
        action = torch.multinomial(chances, 1, generator=self.exploration)
        return step.set("action", action.squeeze(-1))

    def observe(self, step: TensorDictBase) -> None:
        """Add a step to the rollout."""
        assert self._output is not None, "call act() first"
        if self._best is not None:
            self._best.observe(step)
        following = (("next", key) for key in ("state", "done", "terminated"))
        kept = step.select(*KEPT, *following, strict=False)
        kept = kept.clone().set(OUTPUT, self._output)
        kept["next", "reward"] = step["next", "reward"] * self.learn.reward_scale
        self._rollout.append(kept)

    def update(self) -> list[Tensor]:
        """Learn from the rollout if it is full, and return the loss of each minibatch."""
        if len(self._rollout) < self.settings.rollout_steps:
            return []
        steps, losses = self.judge(TensorDict.stack(self._rollout)).flatten(), []
        self._rollout.clear()
        for _ in range(self.settings.epochs):
            order = torch.randperm(len(steps), generator=self._shuffle, device=self._shuffle.device)
            losses += [self.learn_from(steps[rows]) for rows in order.split(self.settings.minibatch_size)]
        return losses

    @torch.no_grad()
    def judge(self, steps: TensorDictBase) -> TensorDictBase:
        """Return a rollout [T, N] with `advantage`, `value_target` and the probabilities of its actions."""
        output, action = steps[OUTPUT], steps["action"].unsqueeze(-1)
        log_prob = mask_values(output, mask_of(steps)).log_softmax(-1)
        steps["action_log_prob"] = log_prob.gather(-1, action).squeeze(-1)
        steps["state_value"] = state_value(output)
        # The next step begins where this one ends, unless the environment was reset between them.
        value = steps["state_value"].roll(-1, 0)
        ends = steps["next", "done"].squeeze(-1).clone()
        ends[-1] = True
        after = steps["next", "state"][ends].split(self.settings.minibatch_size)
        value[ends] = torch.cat([state_value(self.online_network(self.draw(one))) for one in after])
        steps["next", "state_value"] = value
        # A truncated step is not terminated, so it bootstraps.
        judged = self.estimate(steps)
        return judged.select(*KEPT, "action_log_prob", "advantage", "value_target", strict=False)

    def learn_from(self, batch: TensorDictBase) -> Tensor:
        """Take one gradient step on a minibatch [B], and return the loss."""
        seen = self.draw(batch["state"])
        output = check_finite(self.online_network(seen))
        batch = batch.set(self.online_network.observes, seen).set(OUTPUT, output)
        parts = self.loss(batch)
        loss: Tensor = parts["loss_objective"] + parts["loss_critic"] + parts["loss_entropy"]
        if self._imitates and self._best:
            loss = loss - self.settings.imitation_coeff * self._log_likelihood(self._best.take())
        if (penalty := self.method.penalty(self.online_network, batch)) is not None:
            loss = loss + penalty
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(learning_parameters(self.online_network), self.settings.max_grad_norm)
        self.optimiser.step()
        return loss.detach()

    def _log_likelihood(self, best: Best) -> Tensor:
        """Return the mean log probability of an episode's actions."""
        output = check_finite(self.online_network(self.draw(best.steps["state"])))
        log_prob = mask_values(output, mask_of(best.steps)).log_softmax(-1)
        return log_prob.gather(-1, best.steps["action"].unsqueeze(-1)).mean()

    def state_dict(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs."""
        best = self._best.state_dict() if self._best is not None else {}
        state = super().state_dict() | add_prefix("best", best)
        state |= add_prefix("rollout", stack(self._rollout))
        return state | {"shuffle": self._shuffle.get_state()}

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Load what `state_dict` returned."""
        super().load_state_dict(state)
        device = self.online_network.advantage.weight.device
        self._rollout = unstack(strip_prefix("rollout", state), device)
        if self._best is not None:
            self._best.load_state_dict(strip_prefix("best", state), device)
        self._shuffle.set_state(state["shuffle"].cpu())


def check_finite(output: Tensor) -> Tensor:
    """Return outputs of the network, from which probabilities are made.

    Raises:
        DivergedError: one is not finite.
    """
    if not bool(output.isfinite().all()):
        raise DivergedError("an output of the network is not finite")
    return output


def build(setup: Setup) -> PPO:
    """Make PPO with the settings of `config.algorithm`."""
    return PPO(setup)
