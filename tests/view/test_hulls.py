"""No picture for people shows two hulls that touch while their distance is above the safe one."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray

from ship_trl.fast.worlds import draw_starts
from ship_trl.policies.registry import split_suites
from ship_trl.run.entries import find_entries
from ship_trl.sim import scene
from ship_trl.sim.cases import load_suite, load_world
from ship_trl.sim.state import SHIP_COUNT, SHIP_Y, position, target_ships
from ship_trl.view import dashboard, pages, pen
from ship_trl.view.dashboard import Look, draw_dashboard
from ship_trl.view.episode import EpisodeView, view_entry
from tests.view.episodes import run_actions

Corners = NDArray[np.float64]
WORLD = load_world()
# Of films, of a window, and of a telephone.
SIZES = [(960, 540), (1600, 900), (360, 640)]
WORDS = [
    *("random target=2,3,4,6", "keep_course target=1,2,3,4,5,6,new,ship", "pretrained target=1,2,3,4,5,6"),
    "keep_course target=imazu06,imazu12,imazu14",
    "pretrained target=imazu09,imazu17,imazu22",
]
# Metres: farther ships are not looked at, to save time.
NEAR = 120.0


@pytest.fixture
def hulls(monkeypatch: pytest.MonkeyPatch) -> list[Corners]:
    """Collect the corners of hulls in place of drawing them: own ship's first."""
    found: list[Corners] = []

    def collect(_: Any, colour: Any, corners: Sequence[Any], width: float = 0.0) -> None:
        if len(corners) == len(scene.ship_outline(1.0)) and colour in (scene.OWN, scene.TARGET) and not width:
            found.append(np.array(corners))

    monkeypatch.setattr(pen, "polygon", collect)
    for name in ("circle", "write"):
        monkeypatch.setattr(pen, name, lambda *_, **__: 0.0)
    monkeypatch.setattr(dashboard, "_make_graphs", lambda *_: [])
    monkeypatch.setattr(dashboard, "_draw_still", lambda size, *_: pen.new_surface(*size))
    return found


def are_touching(one: Corners, other: Corners) -> bool:
    """Whether two convex polygons [N, 2] touch: no side of either separates them."""
    sides = np.concatenate([np.roll(corners, -1, 0) - corners for corners in (one, other)])
    first, second = ((corners @ (sides[:, ::-1] * [1, -1]).T) for corners in (one, other))
    return bool(((first.max(0) >= second.min(0)) & (second.max(0) >= first.min(0))).all())


def touching_at(hulls: list[Corners], places: Corners) -> list[float]:
    """Return the distances (m) above the safe one of ships at `places` [N, 2] whose hulls touch."""
    assert len(hulls) == len(places)
    pairs = combinations(range(len(places)), 2)
    apart = {(k, m): float(np.linalg.norm(places[k] - places[m])) for k, m in pairs}
    return [
        distance
        for (k, m), distance in apart.items()
        if distance > WORLD.safe_distance and are_touching(hulls[k], hulls[m])
    ]


def frames(view: EpisodeView) -> Iterator[tuple[float, Corners]]:
    """Positions in an episode at which ships are near, twice a step, with the places of all ships."""
    for position_ in np.arange(0.0, view.telemetry.steps + 0.1, 0.5):
        own, ships = view.telemetry.at(position_)
        places = np.concatenate(([own[:2]], ships))
        if any(np.linalg.norm(one - other) < NEAR for one, other in combinations(places, 2)):
            yield position_, places


def test_hulls_that_overlap_touch_and_those_apart_do_not() -> None:
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    assert are_touching(square, square + 1.9) and are_touching(square, square / 4 + 0.5)
    assert not are_touching(square, square + np.array([2.1, 0.0]))
    turned = (square - 1) @ np.array([[1.0, 1.0], [-1.0, 1.0]]) / 2**0.5
    assert not are_touching(square, turned + 1 + 1.8) and are_touching(square, turned + 1 + 1.6)


@pytest.mark.parametrize("words", WORDS)
def test_no_frame_of_a_film_shows_a_collision_that_is_none(words: str, hulls: list[Corners]) -> None:
    shown, wrong = 0, {}
    for entry in split_suites(find_entries(words.split(), colour=False)):
        view = view_entry(entry, 0)
        for at, places in frames(view):
            for size in SIZES:
                hulls.clear()
                draw_dashboard(pygame.Surface(size, depth=32), [view], at, Look())
                shown += 1
                if found := touching_at(hulls, places):
                    wrong[entry.suite.case.name, at, size] = found
    assert shown > 50 and wrong == {}


def test_no_sheet_shows_a_collision_that_is_none(hulls: list[Corners]) -> None:
    imazu = load_suite("imazu", WORLD)
    for state in draw_starts(imazu, WORLD, len(imazu.cases), 0):
        hulls.clear()
        pages.draw_start(state, WORLD, 220, 780.0)
        ships = target_ships(state)[: int(state[SHIP_COUNT]), : SHIP_Y + 1]
        assert touching_at(hulls, np.concatenate((position(state)[None], ships))) == []
    for case in load_suite("paper", WORLD).cases:
        for actions in ((3,), (0, 3, 3)):
            hulls.clear()
            episode = run_actions(case, WORLD, actions)
            pages.draw_paths(episode, WORLD, pages.PATH_SIDE, 800.0)
            last = episode.states[-1]
            ships = target_ships(last)[: int(last[SHIP_COUNT]), : SHIP_Y + 1]
            assert touching_at(hulls, np.concatenate((position(last)[None], ships))) == []
