"""The whole picture: what changes with the step, the look and the size, and what its legend says."""

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, load_case
from ship_trl.view import pen
from ship_trl.view.dashboard import SMALL, Layout, Look, draw_dashboard, step_at
from ship_trl.view.episode import EpisodeView
from ship_trl.view.painter import draw_legend
from ship_trl.view.style import DANGER, FAINT, GOAL_MARK
from tests.view.episodes import drawn, view


@pytest.fixture
def case(world: World) -> Case:
    return load_case("4", world)


@pytest.mark.parametrize("size", [(1600, 900), (800, 800), SMALL.size], ids=["wide", "narrow", "small"])
def test_every_look_is_another_picture(case: Case, world: World, size: tuple[int, int]) -> None:
    one = [view(case, world, (3, 4), network=True)]
    looks = [Look(), Look(relative=True), Look(large=True), Look(saliency=True)]
    pictures = [drawn(one, 5, look, size) for look in looks]
    for k, picture in enumerate(pictures):
        assert all((picture != other).any() for other in pictures[:k])
    assert (pictures[0] == drawn(one, 5, looks[0], size)).all()


def test_the_frame_cache_changes_no_pixel(case: Case, world: World) -> None:
    first, second = [view(case, world, (3, 4))], [view(case, world, (0, 3))]
    surface = pen.new_surface(1280, 720)
    for views, position, look in (
        (first, 3.2, Look()),
        (first, 3.7, Look()),
        (first, 9.0, Look(relative=True)),
        (second, 9.0, Look(relative=True)),
        (second, 2.0, Look()),
        ([*first, *second], 2.0, Look()),
    ):
        draw_dashboard(surface, views, position, look)
        again = [EpisodeView(case, one.title, one.telemetry, one.rasteriser) for one in views]
        assert (pen.to_array(surface) == drawn(again, position, look, (1280, 720))).all()


@pytest.mark.parametrize(
    "size", [(1600, 900), (1920, 1080), (900, 900), (960, 540), (700, 1000), SMALL.size, (640, 360)]
)
@pytest.mark.parametrize("count", [1, 2])
def test_nothing_overlaps_and_nothing_lies_outside(size: tuple[int, int], count: int) -> None:
    layout = Layout(size, count)
    rooms = [room for k in range(count) for room in (layout.scene(k), layout.panel(k))]
    # A small picture has no graphs.
    rooms += [layout.strip] if layout.strip.height else []
    window = pygame.Rect(0, 0, *size)
    for k, room in enumerate(rooms):
        assert window.contains(room) and min(room.size) > 20
        assert not any(room.colliderect(other) for other in rooms[:k])


def test_a_click_in_a_graph_is_a_step(case: Case, world: World) -> None:
    surface, size = pen.new_surface(1600, 900), (1600, 900)
    one = view(case, world, (3, 4))
    draw_dashboard(surface, [one], 0.0, Look())
    found = [step_at(size, [one], (x, 820)) for x in range(1600)]
    assert {step for step in found if step is not None} == set(range(one.telemetry.steps + 1))
    assert step_at(size, [one], (300, 300)) is None
    # The mark moves to where was clicked.
    x = found.index(5)
    before = pen.to_array(surface)
    draw_dashboard(surface, [one], 5.0, Look())
    changed = np.abs(pen.to_array(surface).astype(int) - before).sum(-1)[780:850].sum(0).nonzero()[0]
    assert changed.min() <= x + 30


def test_the_legend_has_every_colour_and_the_distances_of_the_world(world: World) -> None:
    def legend() -> NDArray[np.uint8]:
        strip = pen.new_surface(1200, 40)
        draw_legend(strip, strip.get_rect(), world, 13, 1.0)
        return pen.to_array(strip)

    before = legend()
    colours = {tuple(pixel) for pixel in before.reshape(-1, 3).tolist()}
    assert {scene.OWN, scene.TARGET, GOAL_MARK, FAINT, DANGER} <= colours
    world.safe_distance = 50.0
    assert (legend() != before).any()
