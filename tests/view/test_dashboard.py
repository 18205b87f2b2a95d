"""The whole picture: what changes with the step, the look and the size, and what its legend says."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, load_case
from ship_trl.sim.scale import Scale
from ship_trl.view import pen
from ship_trl.view.dashboard import SMALL, Layout, Look, draw_dashboard, step_at
from ship_trl.view.episode import EpisodeView
from ship_trl.view.painter import draw_legend
from ship_trl.view.style import DANGER, FAINT, GOAL_MARK
from tests.view.episodes import drawn, view


class Word(NamedTuple):
    """A text, the pixels of its letters, and the layer that it is on with its size."""

    text: str
    box: pygame.Rect
    layer: int
    size: tuple[int, int]


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


SIZES = [(1600, 900), (1280, 720), (1024, 600), (921, 540), (3456, 1944), (800, 1000), SMALL.size, (640, 360)]


def words_of(views: list[EpisodeView], size: tuple[int, int], patch: pytest.MonkeyPatch) -> list[Word]:
    """Every text in a dashboard with the pixels that its letters take."""
    found: list[Word] = []
    write = pen.write

    def record(surface: pygame.Surface, text: str, at: pen.Point, *rest: Any, **more: Any) -> float:
        end = write(surface, text, at, *rest, **more)
        size, bold = rest[1], rest[2] if len(rest) > 2 else more.get("bold", False)
        letters = pen.font(size, bold).render(text, True, (0, 0, 0)).get_bounding_rect()
        top = round(at[1] - pen.font(size, bold).size(text)[1] / 2)
        left = round(end) - pen.width_of(text, size, bold)
        box = letters.move(left, top).move(surface.get_abs_offset())
        whole = surface.get_abs_parent()
        # The window is drawn in two layers, a graph on a surface of its own.
        layer = 0 if whole.get_size() == size else id(whole)
        found.append(Word(text, box, layer, whole.get_size()))
        return end

    with patch.context() as inner:
        inner.setattr(pen, "write", record)
        draw_dashboard(pen.new_surface(*size), views, 5.0, Look(), "1 of 7    > 5x    H: keys")
    return found


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", ["network", "planner", "pair", "crowd", "foreign", "foreign pair"])
def test_no_words_overlap_or_leave_the_window(
    kind: str, size: tuple[int, int], world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = load_case("imazu22" if kind == "crowd" else "4", world)
    if kind.startswith("foreign"):
        case = replace(case, scale=Scale(12.35, 0.41, "2025-06-01 08:30:00+00:00"))
    views = [view(case, world, (3, 4), network=kind == "network")] * (2 if kind.endswith("pair") else 1)
    words = words_of(views, size, monkeypatch)
    assert any(word.text.endswith(" UTC") for word in words) == kind.startswith("foreign")
    for k, (text, box, layer, room) in enumerate(words):
        assert pygame.Rect(0, 0, *room).contains(box), f"{text!r} is cut"
        for other, its, where, _ in words[:k]:
            assert where != layer or not box.colliderect(its), f"{text!r} over {other!r}"


def test_in_a_comparison_only_networks_have_a_view_of_the_scene(
    case: Case, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    planner, learner = (view(case, world, (3, 4), network=has) for has in (False, True))
    for views, count in (([planner, planner], 0), ([planner, learner], 1), ([planner], 1)):
        words = words_of(views, (1280, 720), monkeypatch)
        assert sum(word.text.startswith("network's view") for word in words) == count


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
