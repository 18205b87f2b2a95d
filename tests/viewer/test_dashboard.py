"""The whole picture: what changes with the step, the look and the size."""

from collections.abc import Callable

import numpy as np
import pygame
import pytest

from ship_trl.config.types import World
from ship_trl.sim.cases import Case, load_case
from ship_trl.view.draw import to_array
from ship_trl.viewer.dashboard import Dashboard, Look, layout
from tests.viewer.shown import drawn, show


@pytest.fixture
def case(world: World) -> Case:
    return load_case("4", world)


def test_every_look_is_another_picture(case: Case, world: World) -> None:
    one = [show(case, world, (3, 4), network=True)]
    looks = [Look(), Look(absolute=True), Look(to_scale=True), Look(saliency=True)]
    pictures = [drawn(one, 5, look) for look in looks]
    for k, picture in enumerate(pictures):
        assert all((picture != other).any() for other in pictures[:k])
        assert (picture == drawn(one, 5, looks[k])).all()


def test_what_is_kept_from_frame_to_frame_changes_nothing(case: Case, world: World) -> None:
    first, second = [show(case, world, (3, 4))], [show(case, world, (0, 3))]
    surface, kept = pygame.Surface((1280, 720), depth=32), Dashboard()
    for shows, position, look in (
        (first, 3.2, Look()),
        (first, 3.7, Look()),
        (first, 9.0, Look(absolute=True)),
        (second, 9.0, Look(absolute=True)),
        (second, 2.0, Look()),
        ([*first, *second], 2.0, Look()),
    ):
        kept.draw(surface, shows, position, look)
        fresh = drawn(shows, position, look, (1280, 720))
        assert (to_array(surface) == fresh).all()


@pytest.mark.parametrize("size", [(1600, 900), (1920, 1080), (900, 900), (960, 540), (700, 1000)])
@pytest.mark.parametrize("count", [1, 2])
def test_nothing_overlaps_and_nothing_lies_outside(size: tuple[int, int], count: int) -> None:
    unit = min(size[0] / (800 if count == 1 and size[0] < 1.3 * size[1] else 1600), size[1] / 900)
    lanes, strip = layout(size, unit, count, count > 1 or size[0] < 1.3 * size[1])
    rooms = [room for lane in lanes for room in (lane.sea, lane.panel, lane.caption)] + [strip]
    window = pygame.Rect(0, 0, *size)
    for k, room in enumerate(rooms):
        assert window.contains(room) and min(room.size) > 20
        assert not any(room.colliderect(other) for other in rooms[:k])


def test_an_episode_without_ships_without_q_values_and_of_eight_ships(
    make_case: Callable[..., Case], world: World
) -> None:
    crowd = [(-300.0 + 80 * k, 900.0, 270.0, 1.0 + k) for k in range(8)]
    pictures = [drawn([show(make_case(*ships), world, (3,))], 4) for ships in ((), crowd)]
    assert (pictures[0] != pictures[1]).any()


def test_a_click_in_a_graph_is_a_step(case: Case, world: World) -> None:
    dashboard, surface = Dashboard(), pygame.Surface((1600, 900), depth=32)
    one = show(case, world, (3, 4))
    dashboard.draw(surface, [one], 0.0, Look())
    found = [dashboard.step_at((x, 820)) for x in range(1600)]
    steps = [step for step in found if step is not None]
    assert set(steps) == set(range(one.telemetry.steps + 1))
    assert dashboard.step_at((300, 300)) is None
    # The mark moves to where was clicked.
    x = found.index(5)
    before = to_array(surface)
    dashboard.draw(surface, [one], 5.0, Look())
    changed = np.abs(to_array(surface).astype(int) - before).sum(-1)[780:850].sum(0).nonzero()[0]
    assert changed.min() <= x + 30
