"""The rows of a curve, written and read again."""

import math

from hypothesis import given
from hypothesis import strategies as st

from ship_trl.learn.train import Finished
from ship_trl.run.history import from_csv, to_csv, to_row

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
EPISODES = st.builds(
    Finished,
    episode=st.integers(1, 5000),
    steps=st.integers(1, 10**6),
    epsilon=st.floats(0, 1),
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
