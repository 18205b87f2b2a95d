"""The zero-shot score: what a source's network reaches in a target before it is trained there.

Of the measures that were judged it predicts best what a source is worth (studies/sources).
"""

from __future__ import annotations

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import rollout
from ship_trl.policies.reference import best_known, random_return
from ship_trl.sim.cases import Case
from ship_trl.sim.suites import suite_of


def score_bounds(case: Case, world: World) -> tuple[float, float]:
    """Return the mean return of random actions in a case, whose score is 0, and the best known return."""
    return random_return(suite_of(case), world), best_known(case, world).episode_return


def zero_shot(network: DuelingNetwork, case: Case, world: World, bounds: tuple[float, float]) -> float:
    """Return the score of a network's greedy episode in a case: 0 for random actions or worse.

    `bounds` are those of `score_bounds`.
    """
    env = make_env(suite_of(case), world)
    (episode,) = rollout(env, greedy_policy(network, env.observer(network.config, network.colour)))
    random, known = bounds
    return max(0.0, (episode.episode_return - random) / (known - random))
