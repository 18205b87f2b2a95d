"""Charts: each line is at its height, and each panel and legend at its place."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from ship_trl.config.types import World
from ship_trl.files.curve import GREEDY, TRAINING, Row
from ship_trl.files.record import RunRecord
from ship_trl.sim.cases import load_case
from ship_trl.view.charts import draw_comparison, draw_curve, draw_trajectories, draw_transfer
from ship_trl.view.style import ARMS, BLACK, CHART_SERIES, arm_styles, look_of, pair_colours
from tests.a_result import a_result
from tests.view.episodes import run_actions

OUTCOMES = ("collision", "timeout", "goal")
TRAINED: list[Row] = [
    {"episode": k, "epsilon": 1 - k / 100, "return": 3.0 * k - 300, "outcome": OUTCOMES[k % 3]}
    for k in range(1, 101)
]
EVALUATED: list[Row] = [
    {"episode": 50 * k, "greedy_return": number, "greedy_outcome": outcome, "greedy_episodes": 1}
    for k, (number, outcome) in enumerate(((-320.0, "collision"), (-500.0, "timeout"), (60.0, "goal")))
]


def read(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def pixels_of(picture: NDArray[np.uint8], colour: str) -> NDArray[np.int64]:
    """Rows and columns of a colour, [N, 2]."""
    return np.argwhere((picture == tuple(bytes.fromhex(colour[1:]))).all(-1))


def test_the_mean_rises_with_the_returns(tmp_path: Path) -> None:
    draw_curve(tmp_path / "curve.png", [*TRAINED, *EVALUATED], 63.7, "case 3 -> case 4, FT3, seed 0")
    picture = read(tmp_path / "curve.png")
    assert picture.shape == (800, 1200, 3)
    blue = pixels_of(picture[:, :850], CHART_SERIES[0])
    left, right = (blue[:, 1] < np.quantile(blue[:, 1], 0.2)), (blue[:, 1] > np.quantile(blue[:, 1], 0.8))
    assert blue[left, 0].mean() > blue[right, 0].mean() + 100


@pytest.mark.parametrize(
    "rows",
    [
        EVALUATED[:1],
        [*EVALUATED[:1], *TRAINED[:2]],
        [{key: row[key] for key in row if key != "epsilon"} for row in (*TRAINED, *EVALUATED)],
    ],
    ids=["no episode", "two episodes", "no epsilon"],
)
def test_a_curve_of_few_episodes_is_drawn(tmp_path: Path, rows: list[Row]) -> None:
    # A dollar sign in a title is no formula.
    draw_curve(tmp_path / "curve.png", rows, 83.9, "case $mine{$_1, scratch, seed 0")
    assert read(tmp_path / "curve.png").shape == (800, 1200, 3)


def test_the_mean_of_many_episodes_is_a_line(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).choice((-600.0, 80.0), 20_000)
    rows: list[Row] = [
        {"episode": k, "epsilon": 0.1, "return": value, "outcome": "goal" if value > 0 else "collision"}
        for k, value in enumerate(noise.tolist())
    ]
    draw_curve(tmp_path / "curve.png", rows, None, "traffic")
    blue = pixels_of(read(tmp_path / "curve.png")[60:560, 150:850], CHART_SERIES[0])
    assert len(set(blue[:, 1])) > 600 and np.ptp(blue[:, 0]) < 220


@pytest.mark.parametrize("seeds", [1, 5])
def test_a_transfer_and_scratch_have_their_lines_at_their_heights(tmp_path: Path, seeds: int) -> None:
    """The line of scratch is black as letters are, but long and inside the axes; the better line is above."""
    scratch = np.full((seeds, 100), -200.0) + np.linspace(0.0, 4.0, seeds)[:, None]
    draw_transfer(tmp_path / "transfer.png", "FT3", [50.0] * 120, scratch, 83.9, "case $1 -> case 2_")
    picture = read(tmp_path / "transfer.png")
    axes = picture[60:600, 120:1100]
    run, black = pixels_of(axes, look_of("FT3")["color"]), pixels_of(axes, BLACK)
    assert len(set(run[:, 1])) > 600 and len(set(black[:, 1])) > 600
    assert np.ptp(black[:, 0]) < 10 and np.ptp(run[:, 0]) < 10
    assert black[:, 0].min() > run[:, 0].max() + 200


def curve(level: float, episodes: int = 60) -> RunRecord:
    return made(np.full(episodes, level), np.full(7, level))


def made(returns: NDArray[np.float64], greedy: NDArray[np.float64]) -> RunRecord:
    """A run whose greedy evaluations are ten episodes apart."""
    parts = (TRAINING, np.arange(1, len(returns) + 1), returns), (GREEDY, 10 * np.arange(len(greedy)), greedy)
    rows = [pd.DataFrame({"kind": kind, "episode": at, "return": values}) for kind, at, values in parts]
    table = pd.concat(rows).assign(epsilon=np.nan, outcome="goal", dcpa=np.nan)
    return a_result(best_known_return=60.0, rows=table)


def test_every_arm_has_its_line_at_its_height_and_panels_stand_in_rows_of_three(tmp_path: Path) -> None:
    path = tmp_path / "curves.png"
    groups = {"FE1": [curve(0.0), curve(10.0), curve(5.0)], "FT2": [curve(50.0), curve(50.0, 55)]}
    names = [f"case {k}" for k in range(5)]
    draw_comparison(path, dict.fromkeys(names, groups))
    picture = read(path)
    assert picture.shape == (1280, 1560, 3)
    places = picture.reshape(2, 640, 3, 520, 3)
    assert (places < 128).any((1, 3, 4)).tolist() == [[True] * 3, [True, True, False]]
    # The lower half of the first panel, without its legend.
    heights = [np.median(pixels_of(picture[300:560, :520], colour)[:, 0]) for colour in CHART_SERIES[:2]]
    assert heights[0] > heights[1] + 50


def test_the_legend_covers_no_line(tmp_path: Path) -> None:
    path = tmp_path / "curves.png"
    falling = made(np.linspace(60, -300, 60), np.linspace(60, -90, 7))
    draw_comparison(path, {"case 4": {"falling": [falling]}})
    line = pixels_of(read(path), CHART_SERIES[0])
    # In both halves it goes on to the right end of the axes without a gap.
    for top, bottom in ((0, 300), (300, 570)):
        columns = np.unique(line[(line[:, 0] >= top) & (line[:, 0] < bottom), 1])
        assert columns[0] < 130 and columns[-1] > 490 and np.diff(columns).max() <= 3


@pytest.mark.parametrize(("highest", "words"), [(30.0, " above \N{MINUS SIGN}100"), (-150.0, "")])
def test_an_axis_that_is_cut_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, highest: float, words: str
) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr("ship_trl.view.style.save_figure", lambda figure, _: drawn.append(figure))
    run = made(np.zeros(9), np.linspace(-300, highest, 7))
    better = made(np.zeros(9), np.linspace(-300, 60, 7))
    draw_comparison(tmp_path / "curves.png", {"case 4": {"FT3": [run], "FTW": [better]}})
    lower = drawn[0].axes[1]
    assert lower.get_ylabel().splitlines()[0] == f"greedy return{words}"
    assert (lower.get_ylim()[0] <= -300) == (highest < -100)


@pytest.mark.parametrize(("case", "panels"), [("4", 1), ("4", 6), ("1", 1)])
def test_each_group_of_paths_has_a_panel(world: World, tmp_path: Path, case: str, panels: int) -> None:
    chosen = load_case(case, world)
    one = run_actions(chosen, world, (3, 4))
    # A name is no formula.
    draw_trajectories(tmp_path / "paths.png", chosen, world, {f"$g_{k}$": [one] for k in range(panels)})
    apart = read(tmp_path / "paths.png").astype(int) - list(bytes.fromhex(CHART_SERIES[0][1:]))
    assert (np.abs(apart).max(-1) < 12).sum() > 100 + 150 * panels


def test_numbers_of_ships_on_one_path_do_not_overlap(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = load_case("4", world)
    crowded = replace(case, target_ships=[case.target_ships[0]] * 3)
    drawn: list[Figure] = []
    monkeypatch.setattr("ship_trl.view.style.save_figure", lambda figure, _: drawn.append(figure))
    episodes = {f"group {k}": [run_actions(crowded, world, (3, 4))] for k in range(6)}
    draw_trajectories(tmp_path / "paths.png", crowded, world, episodes)
    (figure,) = drawn
    figure.draw_without_rendering()
    for axes in figure.axes[:6]:
        boxes = [text.get_window_extent() for text in axes.texts]
        assert len(boxes) == 3
        assert not any(box.overlaps(other) for k, box in enumerate(boxes) for other in boxes[:k])


def test_an_arm_looks_alike_wherever_it_is_named() -> None:
    styles = arm_styles(["scratch", "a/b: FT3", "FE3-random", "SP2", "FT3"])
    assert styles["FT3"]["color"] == styles["a/b: FT3"]["color"] == look_of("FT3")["color"]
    # The same arm with other settings: another line.
    assert styles["FT3"] != styles["a/b: FT3"] == look_of("FT3")
    assert styles["SP2"] == look_of("SP9") and styles["FE3-random"] == look_of("FT4-random")
    looks = list(ARMS.values())
    assert not any(look in looks[:k] for k, look in enumerate(looks))


def test_in_a_film_two_arms_have_their_colours_and_others_the_usual_pair() -> None:
    first, second = pair_colours(["high FT3 seed 0, best", "high scratch seed 0, best"])
    assert pair_colours(["low FT3 seed 4, final", "vo"])[0] == first
    usual = pair_colours(["vo", "random"])
    assert pair_colours(["high FT3 seed 0, best", "high FT3 seed 1, best"]) == usual
    assert len({first, second, *usual}) == 4
