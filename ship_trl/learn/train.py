"""The training loop. It yields events, so that logging, pictures and progress stay outside."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import EnvBase

from ship_trl.config.types import Learn
from ship_trl.learn.algorithm import Algorithm, DivergedError, add_prefix, strip_prefix
from ship_trl.learn.rollout import Episode, mean_return, outcome, rollout


@dataclass(frozen=True)
class Finished:
    """A training episode that ended.

    `loss` is the mean over the updates since the last episode ended; None without updates.
    """

    episode: int
    steps: int
    epsilon: float
    episode_return: float
    length: int
    outcome: str
    dcpa: float
    loss: float | None


@dataclass(frozen=True)
class Evaluated:
    """The greedy episodes of an evaluation after `episode` training episodes; 0 means before training."""

    episode: int
    steps: int
    episodes: list[Episode]

    @property
    def episode_return(self) -> float:
        """Mean return of the episodes."""
        return mean_return(self.episodes)


class Training:
    """Train for `learn.episodes` episodes, one step of the batched environment at a time.

    Between two steps a training can be saved by `state_dict`, and resumed by `load_state_dict` with parts
    made in the same way. On a CPU the results have the same bits.

    Args:
        env: batched environment with `state` and `action`; `goal`, `collision` and `dcpa` are reported.
        eval_env: the same world; an evaluation is an episode of each of its rows.
        algorithm: acts and learns.
        learn: how many episodes, and how many between two evaluations.
    """

    def __init__(self, env: EnvBase, eval_env: EnvBase, algorithm: Algorithm, learn: Learn) -> None:
        self._env, self._eval_env, self._learn = env, eval_env, learn
        self.algorithm = algorithm
        self.episode = self.steps = 0
        count = env.batch_size[0]
        self._returns = torch.zeros(count, dtype=torch.float64, device=env.device)
        self._lengths = torch.zeros(count, dtype=torch.int64, device=env.device)
        # Of the updates since the last episode ended: environment step and loss.
        self._losses: list[tuple[int, torch.Tensor]] = []
        self._current: TensorDictBase | None = None

    @property
    def is_finished(self) -> bool:
        """Whether all episodes have ended."""
        return self.episode >= self._learn.episodes

    def advance(self) -> Iterator[Finished | Evaluated]:
        """Step all environments once, make the updates that are due, and yield the episodes that ended.

        The first call evaluates the policy before it learns.

        Raises:
            DivergedError: a loss or a Q-value is not finite.
        """
        if self._current is None:
            yield self._evaluate()
            self._current = self._env.reset()
        algorithm = self.algorithm
        stepped, self._current = self._env.step_and_maybe_reset(algorithm.act(self._current, self.episode))
        algorithm.observe(stepped)
        self.steps += len(self._returns)
        after = stepped["next"]
        self._returns += after["reward"].squeeze(-1)
        self._lengths += 1
        self._losses += [(self.steps, loss) for loss in algorithm.update()]
        done = after["done"].squeeze(-1)
        for row in done.nonzero().squeeze(-1).tolist():
            if self.is_finished:
                break
            self.episode += 1
            yield Finished(
                episode=self.episode,
                steps=self.steps,
                epsilon=algorithm.epsilon,
                episode_return=float(self._returns[row]),
                length=int(self._lengths[row]),
                outcome=outcome(bool(after["goal"][row]), bool(after["collision"][row])),
                dcpa=float(after["dcpa"][row]),
                loss=self._mean_loss(),
            )
            self._losses.clear()
            if self.episode % self._learn.evaluate_every == 0 or self.is_finished:
                yield self._evaluate()
        # Also those of episodes that end with the last one and do not count: a longer training may go on.
        self._returns[done], self._lengths[done] = 0.0, 0

    def _mean_loss(self) -> float | None:
        """Return the mean loss since the last episode ended, or None without updates."""
        if not self._losses:
            return None
        losses = torch.stack([loss for _, loss in self._losses])
        mean = float(losses.mean())
        if not math.isfinite(mean):
            # Name the first loss that is not finite, or the last loss if only the sum overflows.
            first = ((~losses.isfinite()).nonzero().flatten().tolist() or [len(losses) - 1])[0]
            step, _ = self._losses[first]
            raise DivergedError(f"the loss is {float(losses[first])} at environment step {step}")
        return mean

    def _evaluate(self) -> Evaluated:
        """Roll out greedy episodes."""
        episodes = rollout(self._eval_env, self.algorithm.greedy)
        if not all(one.q_values is None or bool(one.q_values.isfinite().all()) for one in episodes):
            raise DivergedError(f"a Q-value is not finite after environment step {self.steps}")
        return Evaluated(self.episode, self.steps, episodes)

    def check_finite(self) -> None:
        """Check losses and weights; a bad weight may not have reached the loss or an evaluation yet.

        Raises:
            DivergedError: a loss or a weight is not finite.
        """
        self._mean_loss()
        if not all(bool(value.isfinite().all()) for value in self.algorithm.state_dict().values()):
            raise DivergedError(f"a weight is not finite after environment step {self.steps}")

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return everything needed to resume, as tensors on the CPU by dotted names."""
        assert self._current is not None, "call advance() first"
        flat = self._current.flatten_keys(".")
        own = {
            "counters": torch.tensor([self.episode, self.steps]),
            "returns": self._returns,
            "lengths": self._lengths,
            "losses": torch.tensor([float(loss) for _, loss in self._losses]),
            **add_prefix("current", {str(key): flat.get(key) for key in flat.keys()}),  # noqa: SIM118
            "loss_steps": torch.tensor([step for step, _ in self._losses], dtype=torch.int64),
            **add_prefix("algorithm", self.algorithm.state_dict()),
        }
        return {name: value.detach().cpu() for name, value in own.items()}

    def load_state_dict(self, state: Mapping[str, torch.Tensor]) -> None:
        """Resume from a `state_dict`.

        Raises:
            KeyError, RuntimeError, TypeError, ValueError: the state does not fit this training.
        """
        if state["counters"].dtype is not torch.int64:
            raise TypeError("counters must be int64")
        self.episode, self.steps = state["counters"].tolist()
        self._returns.copy_(state["returns"])
        self._lengths.copy_(state["lengths"])
        device = self._env.device
        self._losses = list(zip(state["loss_steps"].tolist(), state["losses"].to(device), strict=True))
        current = {key: value.to(device) for key, value in strip_prefix("current", state).items()}
        self._current = TensorDict(current, self._env.batch_size, device=device).unflatten_keys(".")
        self.algorithm.load_state_dict(strip_prefix("algorithm", state))


def train(
    env: EnvBase, eval_env: EnvBase, algorithm: Algorithm, learn: Learn
) -> Iterator[Finished | Evaluated]:
    """Train from the first episode to the last, and yield the events; see `Training`.

    Yields:
        `Finished` for each episode; `Evaluated` before the first, every `evaluate_every`, and after the last.
    """
    training = Training(env, eval_env, algorithm, learn)
    while not training.is_finished:
        yield from training.advance()
