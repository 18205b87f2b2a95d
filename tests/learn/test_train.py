"""The training loop, in a world that is not the simulator."""

import itertools
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDictBase

from ship_trl.config.types import Learn
from ship_trl.learn.algorithm import DivergedError, epsilon_at, learning_rate_at
from ship_trl.learn.double_dqn import DoubleDQN, build
from ship_trl.learn.train import Evaluated, Finished, train
from tests.learn.worlds import Corridor, corridor_setup, schedule


def make(learn: Learn, seed: int = 0) -> DoubleDQN:
    return build(corridor_setup(seed, learn))


def events(seed: int = 0, **changes: object) -> tuple[list[Finished | Evaluated], DoubleDQN]:
    learn = schedule(**changes)
    algorithm = make(learn, seed)
    return list(train(Corridor(learn.num_envs), Corridor(1), algorithm, learn)), algorithm


def test_it_learns() -> None:
    found, _ = events(episodes=120, lr=1e-3)
    returns = [e.episode_return for e in found if isinstance(e, Evaluated)]
    assert max(returns[1:]) == 96.0


def test_every_episode_is_reported_once_and_in_order() -> None:
    found, _ = events(5)
    episodes = [e for e in found if isinstance(e, Finished)]
    assert [e.episode for e in episodes] == list(range(1, 31))
    for e in episodes:
        gain = {"goal": 100, "collision": -100, "timeout": 0}[e.outcome]
        assert e.episode_return == gain - e.length
        assert e.length == 12 if e.outcome == "timeout" else 4 <= e.length <= 12
    assert {e.outcome for e in episodes} == {"goal", "collision", "timeout"}


def test_same_seed_same_bits_and_two_seeds_share_nothing() -> None:
    (first, one), (again, two), (other, three) = events(1), events(1), events(2)
    assert [e for e in first if isinstance(e, Finished)] == [e for e in again if isinstance(e, Finished)]
    for a, b, c in zip(
        one.network.parameters(), two.network.parameters(), three.network.parameters(), strict=True
    ):
        assert torch.equal(a, b) and not torch.equal(a, c)
    lengths = [[e.length for e in run if isinstance(e, Finished)] for run in (first, other)]
    assert lengths[0] != lengths[1]


def test_a_loss_that_is_not_finite_is_reported_with_its_step() -> None:
    learn = schedule()
    algorithm = make(learn)
    update, losses = algorithm.learn_from, itertools.count(1)

    def diverging(batch: TensorDictBase) -> torch.Tensor:
        loss = update(batch)
        return loss * math.nan if next(losses) >= 5 else loss

    algorithm.learn_from = diverging  # type: ignore[method-assign]
    step = learn.warmup_steps + 5 * learn.update_every
    with pytest.raises(DivergedError, match=f"the loss is nan at environment step {step}$"):
        list(train(Corridor(1), Corridor(1), algorithm, learn))


@given(episode=st.integers(0, 1000), fraction=st.floats(0.1, 1.0))
def test_epsilon_falls_linearly_and_then_stays(episode: int, fraction: float) -> None:
    learn = schedule(episodes=1000, epsilon_fraction=fraction, epsilon_end=0.1)
    got = epsilon_at(episode, learn)
    annealed = fraction * 1000
    assert got == pytest.approx(max(0.1, 1.0 - 0.9 * episode / annealed))
    assert 0.1 - 1e-12 <= got <= 1.0


def test_learning_rate_falls_linearly_and_reaches_the_optimiser() -> None:
    learn = schedule(lr=1e-3, lr_end=1e-4)
    assert learning_rate_at(0, learn) == 1e-3
    assert learning_rate_at(15, learn) == pytest.approx(5.5e-4)
    assert learning_rate_at(30, learn) == pytest.approx(1e-4)
    _, algorithm = events(lr=1e-3, lr_end=1e-4)
    # The last update is made before the last episode ends.
    assert algorithm.optimiser.param_groups[0]["lr"] < 2e-4
