"""The GIF: as many frames as states, in time, small, and with the right numbers beside it."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image, ImageSequence

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, load_case
from ship_trl.sim.render import Rasteriser
from ship_trl.view.film import LAST_TIME, STEP_TIME, draw_frames, write_gif
from ship_trl.view.legend import HEIGHT as LEGEND
from ship_trl.view.lettering import CHOSEN, fit
from ship_trl.view.panel import HEIGHT, LEFT, LOWER, RIGHT, VIEW, WIDTH, Log
from tests.view.sailing import sail


def test_a_long_episode_as_gif(world: World, tmp_path: Path) -> None:
    case = load_case("6", world)
    # Circling to port: every frame turns, and the step limit ends it.
    episode = sail(case, world, [0])
    assert episode.length == world.max_steps
    path = tmp_path / "episode.gif"
    write_gif(path, case, world, episode, Rasteriser(case, world), "case 5 -> case 6, FT3, seed 0")
    assert [p.name for p in tmp_path.iterdir()] == ["episode.gif"]
    assert path.stat().st_size < 1_500_000
    with Image.open(path) as film:
        assert film.size == (HEIGHT + WIDTH, HEIGHT + LEGEND)
        assert film.info["loop"] == 0
        times = [frame.info["duration"] for frame in ImageSequence.Iterator(film)]
        last = film.convert("RGB")
    assert times == [STEP_TIME] * episode.length + [LAST_TIME]
    # Flat colours survive the shared palette as they are.
    assert last.getpixel((2, 2)) == scene.OUTSIDE
    assert last.getpixel((HEIGHT // 2, HEIGHT - 20)) == scene.DISC


def test_gif_frames_are_the_drawn_ones(world: World, tmp_path: Path) -> None:
    case = load_case("3", world)
    episode, draw = sail(case, world, [3]), Rasteriser(case, world, colour=True)
    frames = draw_frames(case, world, episode, draw)
    write_gif(tmp_path / "episode.gif", case, world, episode, draw)
    with Image.open(tmp_path / "episode.gif") as film:
        for drawn, frame in zip(frames, ImageSequence.Iterator(film), strict=True):
            apart = np.asarray(drawn).astype(int) - np.asarray(frame.convert("RGB"))
            assert np.abs(apart).mean() < 1.0


@pytest.mark.parametrize("colour", [False, True])
def test_the_networks_view_is_in_the_frame(world: World, colour: bool) -> None:
    case = load_case("4", world)
    episode, draw = sail(case, world, [5]), Rasteriser(case, world, colour=colour)
    frame = draw_frames(case, world, episode, draw)[7]
    corner = (HEIGHT + RIGHT, LOWER)
    view = frame.crop((*corner, corner[0] + VIEW, corner[1] + VIEW)).resize(
        (84, 84), Image.Resampling.NEAREST
    )
    assert (np.moveaxis(np.asarray(view), -1, 0) == draw(episode.states[7]).numpy()).all()


def test_the_chosen_action_is_marked(world: World) -> None:
    """Action k alone has the highlighted bar in frame k; after the last step nothing is chosen."""
    case = load_case("1", world)
    sailed = sail(case, world, [3])
    taken = torch.arange(7)
    # Seven steps of a longer voyage, each with another action, and a Q-value for each.
    q_values = torch.full((7, 7), 0.1) + 0.3 * torch.eye(7)
    episode = Episode(sailed.states[:8], taken, q_values, sailed.rewards[:7], False, False, math.inf)
    frames = draw_frames(case, world, episode, Rasteriser(case, world))
    pitch = VIEW / 7
    for step, frame in enumerate(frames):
        column = [frame.getpixel((HEIGHT + LEFT + 40, round(LOWER + (k + 0.5) * pitch))) for k in range(7)]
        assert [colour == CHOSEN for colour in column] == [k == step for k in range(7)]


def test_log_of_a_collision(world: World) -> None:
    case = load_case("3", world)
    episode = sail(case, world, [3])
    log = Log.of(case, world, episode)
    assert episode.outcome == "collision"
    assert len(log.total) == len(log.goal) == len(log.closest) == episode.length + 1
    assert log.total[0] == 0.0
    assert log.total[-1] == pytest.approx(episode.episode_return)
    assert log.closest[0] == pytest.approx(math.hypot(259.8, 450.0))
    assert log.closest == sorted(log.closest, reverse=True)
    assert log.closest[-1] == pytest.approx(episode.dcpa)
    assert log.goal[:2] == pytest.approx([600.0, 585.0])


def test_log_sees_a_ship_pass_within_a_step(world: World, make_case: Callable[..., Case]) -> None:
    """At 215 m/s it is 104 m away before and after, and 60 m abeam in between."""
    case = make_case((60.0, 300.0, 270.0, 200.0))
    log = Log.of(case, world, sail(case, world, [3]))
    assert log.closest[1:4] == pytest.approx([104.04, 60.0, 60.0], abs=0.01)


def test_log_without_target_ships(world: World, make_case: Callable[..., Case]) -> None:
    case = make_case()
    assert set(Log.of(case, world, sail(case, world, [3])).closest) == {math.inf}


def test_a_long_title_is_fitted() -> None:
    text, letters = fit("case 1", 300, 17)
    assert text == "case 1" and letters.size == 17
    text, letters = fit("a title that is far too long for it " * 4, 300, 17, bold=True)
    assert text.endswith("…") and letters.getlength(text) <= 300
