"""Maps alone: of one episode with its actions, or of many."""

import numpy as np
import pytest
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.sim.cases import load_case
from ship_trl.view import pen
from ship_trl.view.episode import EpisodeView
from ship_trl.view.maps import draw_maps
from ship_trl.view.style import CHOSEN, DANGER, OUTCOMES
from tests.view.episodes import view


def drawn(views: list[EpisodeView], position: float, size: tuple[int, int] = (640, 780)) -> NDArray[np.uint8]:
    surface = pen.new_surface(*size)
    draw_maps(surface, views, position)
    return pen.to_array(surface)


def places(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> NDArray[np.int64]:
    return np.argwhere((picture == colour).all(-1))


@pytest.mark.parametrize("action", [0, 6])
def test_the_chosen_action_is_bright(action: int, world: World) -> None:
    bright = places(drawn([view(load_case("2", world), world, (action,))], 0.0), CHOSEN)
    assert len(bright) and (bright[:, 0] > 640).all()
    assert ((bright[:, 1] - 320 > 0) == (action == 6)).all()


def test_many_maps_stand_side_by_side_and_say_how_episodes_end(world: World) -> None:
    views = [view(load_case(name, world), world, (3,)) for name in ("1", "2", "3", "4")]
    picture = drawn(views, 100.0, (800, 260))
    ends = [places(picture[:, left : left + 200], OUTCOMES["goal"]) for left in range(0, 800, 200)]
    assert [len(found) > 0 for found in ends] == [True, True, False, False]
    assert len(places(picture[:, 400:], DANGER))
    assert (drawn(views, 0.0, (800, 260)) != picture).any()
