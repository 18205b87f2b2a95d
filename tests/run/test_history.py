"""The rows of a curve, written and read again."""

import math

from hypothesis import given
from hypothesis import strategies as st
from torch import Generator

from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.train import Finished
from ship_trl.run.history import History, from_csv, to_csv, to_row

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
EPISODES = st.builds(
    Finished,
    episode=st.integers(1, 5000),
    steps=st.integers(1, 10**6),
    epsilon=st.floats(0, 1) | st.just(math.nan),
    episode_return=NUMBERS,
    length=st.integers(1, 200),
    outcome=st.sampled_from(["goal", "collision", "timeout"]),
    dcpa=st.floats(0, 1e6) | st.just(math.inf),
    loss=st.none() | NUMBERS,
)


@given(st.lists(EPISODES, max_size=5))
def test_rows_are_read_as_they_were(episodes: list[Finished]) -> None:
    rows = [to_row(episode) for episode in episodes]
    assert from_csv(to_csv(rows)) == rows


def test_episodes_of_an_algorithm_without_epsilon_are_whole() -> None:
    history = History(DuelingNetwork(1, 3, Generator()))
    episode = Finished(1, 30, math.nan, 5.0, 30, "goal", 60.0, None)
    history.rows = from_csv(to_csv([to_row(episode)]))
    (found,) = history.finished
    assert math.isnan(found.epsilon) and found.episode_return == 5.0
