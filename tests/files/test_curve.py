"""A run's learning curve: what is read of the file, what is refused, and the moving mean."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from ship_trl.files.curve import (
    COLUMNS,
    CURVE,
    GREEDY,
    TRAINING,
    RunError,
    moving_mean,
    read_curve,
    write_curve,
)

HEADING = ",".join(COLUMNS) + "\n"
LINES = [
    "0,0,,,,,,,-300.5,12,collision,41.25\n",
    "1,9,1.0,-250.25,9,collision,12.5,,,,,\n",
    "2,60,0.1,10.123456789012345,51,goal,,0.5,,,,\n",
    "2,60,,,,,,,20.0,50,goal,\n",
]


def test_a_line_is_an_episode_or_an_evaluation(tmp_path: Path) -> None:
    (tmp_path / CURVE).write_text(HEADING + "".join(LINES))
    rows = read_curve(tmp_path)
    assert rows["kind"].tolist() == [GREEDY, TRAINING, TRAINING, GREEDY]
    assert rows["episode"].tolist() == [0, 1, 2, 2]
    # To the last bit.
    assert rows["return"].tolist() == [-300.5, -250.25, 10.123456789012345, 20.0]
    assert rows["outcome"].tolist() == ["collision", "collision", "goal", "goal"]
    np.testing.assert_array_equal(rows["dcpa"], [41.25, 12.5, np.nan, np.nan])
    np.testing.assert_array_equal(rows["epsilon"], [np.nan, 1.0, 0.1, np.nan])


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    (tmp_path / CURVE).write_text(HEADING + "".join(LINES))
    rows = read_curve(tmp_path)
    write_curve(tmp_path, rows)
    assert read_curve(tmp_path).equals(rows)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "is missing"),
        ("", "cannot be read"),
        ("step,loss\n1,2\n", "cannot be read"),
        (HEADING.rstrip("\n") + ",x" * 500_000, "cannot be read"),
        ("\x00\xff", "cannot be read"),
        (HEADING + LINES[1].replace("-250.25", "x"), "cannot be read"),
        (HEADING + LINES[1].replace("1,9", "1.5,9"), "cannot be read"),
        (HEADING + LINES[1].replace("1,9", "99999999999999999999999,9"), "cannot be read"),
        (HEADING + LINES[1].replace("1,9", "1e400,9"), "cannot be read"),
        (HEADING + LINES[1].rstrip("\n"), "ends within a line"),
        (HEADING + "1,9,,,,,,,,,,\n", "neither an episode nor an evaluation"),
        (HEADING + "1,9,1.0,5.0,9,goal,,,6.0,9,goal,\n", "neither an episode nor an evaluation"),
    ],
)
def test_an_incomplete_curve_is_refused(text: str | None, said: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / CURVE).write_text(text)
    with pytest.raises(RunError, match=said):
        read_curve(tmp_path)


@given(arrays.arrays(np.float64, st.integers(1, 40), elements=st.floats(-500, 500)), st.integers(1, 50))
def test_a_moving_mean_is_the_mean_of_the_last(values: np.ndarray, window: int) -> None:
    means = [np.mean(values[max(0, k + 1 - window) : k + 1]) for k in range(len(values))]
    np.testing.assert_allclose(moving_mean(values, window), means, atol=1e-9)
