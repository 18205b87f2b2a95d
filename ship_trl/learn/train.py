"""The training loop: a generator, so that logging, pictures and progress stay outside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torchrl.envs import EnvBase

from ship_trl.config import Learn
from ship_trl.learn.agent import Agent
from ship_trl.learn.replay import StateReplay
from ship_trl.learn.rollout import Episode, outcome, rollout


@dataclass(frozen=True)
class Finished:
    """A training episode that ended. `loss` is the mean since the one before, None without updates."""

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
    """A greedy evaluation after `episode` training episodes; 0 is before training."""

    episode: int
    steps: int
    sailed: Episode


def epsilon_at(episode: int, learn: Learn) -> float:
    """Exploration rate after `episode` episodes: linear over the first share of them, then still."""
    share = min(1.0, episode / (learn.epsilon_fraction * learn.episodes))
    return learn.epsilon_start + share * (learn.epsilon_end - learn.epsilon_start)


def learning_rate_at(episode: int, learn: Learn) -> float:
    """Learning rate after `episode` episodes: linear from `lr` to `lr_end` at the last."""
    return learn.lr + min(1.0, episode / learn.episodes) * (learn.lr_end - learn.lr)


def train(
    env: EnvBase, eval_env: EnvBase, agent: Agent, replay: StateReplay, learn: Learn
) -> Iterator[Finished | Evaluated]:
    """Train for `learn.episodes` episodes and yield what happens.

    Args:
        env: batched environment with `state`, `action`, and `goal`, `collision`, `dcpa` to report.
        eval_env: the same world with a batch of one.
        agent: what acts and learns.
        replay: where its experience goes.
        learn: the schedule.

    Yields:
        `Evaluated` before the first and after the last episode and every `evaluate_every`, and
        `Finished` for each episode, in order.
    """
    device = env.device
    count = env.batch_size[0]
    returns = torch.zeros(count, dtype=torch.float64, device=device)
    lengths = torch.zeros(count, dtype=torch.int64, device=device)
    losses: list[torch.Tensor] = []
    episode = steps = updates = 0
    yield Evaluated(0, 0, rollout(eval_env, agent.greedy)[0])
    current = env.reset()
    while episode < learn.episodes:
        agent.policy.epsilon = epsilon_at(episode, learn)
        agent.set_learning_rate(learning_rate_at(episode, learn))
        stepped, current = env.step_and_maybe_reset(agent.policy(current))
        replay.extend(stepped)
        steps += count
        after = stepped["next"]
        returns += after["reward"].squeeze(-1)
        lengths += 1
        while steps >= learn.warmup_steps and updates < (steps - learn.warmup_steps) // learn.update_every:
            losses.append(agent.update(replay.sample(learn.batch_size)))
            updates += 1
        for row in after["done"].squeeze(-1).nonzero().squeeze(-1).tolist():
            if episode == learn.episodes:
                break
            episode += 1
            yield Finished(
                episode=episode,
                steps=steps,
                epsilon=agent.policy.epsilon,
                episode_return=float(returns[row]),
                length=int(lengths[row]),
                outcome=outcome(bool(after["goal"][row]), bool(after["collision"][row])),
                dcpa=float(after["dcpa"][row]),
                loss=float(torch.stack(losses).mean()) if losses else None,
            )
            losses.clear()
            returns[row], lengths[row] = 0.0, 0
            if episode % learn.evaluate_every == 0 or episode == learn.episodes:
                yield Evaluated(episode, steps, rollout(eval_env, agent.greedy)[0])
