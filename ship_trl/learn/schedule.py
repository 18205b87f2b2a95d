"""What changes with the episodes of a training: exploration and learning rate."""

from __future__ import annotations

from ship_trl.config.types import Learn


def epsilon_at(episode: float, learn: Learn) -> float:
    """Return the exploration rate after `episode` episodes: linear over `epsilon_fraction`, then constant."""
    share = min(1.0, episode / (learn.epsilon_fraction * learn.episodes))
    return learn.epsilon_start + share * (learn.epsilon_end - learn.epsilon_start)


def learning_rate_at(episode: float, learn: Learn) -> float:
    """Return the learning rate after `episode` episodes: linear from `lr` to `lr_end`."""
    return learn.lr + min(1.0, episode / learn.episodes) * (learn.lr_end - learn.lr)
