"""A real window of SDL's, real events in its queue, and the pictures that follow."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray
from PIL import Image

from ship_trl.config.errors import ConfigError
from ship_trl.view.draw import to_array
from ship_trl.viewer.playlist import Playlist
from ship_trl.viewer.session import KEYS, Session
from ship_trl.viewer.window import Window, open_window
from tests.viewer.shown import entry

SIZE = (1120, 630)


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[Window]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with open_window(SIZE, "test") as opened:
        yield opened


@pytest.fixture
def session(tmp_path: Path) -> Session:
    policies = [entry("keep_course"), entry("random")]
    made = Session(Playlist(policies), tmp_path / "saved")
    made.player.pause()
    return made


def read(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as opened:
        return np.asarray(opened).copy()


def press(window: Window, session: Session, *keys: str) -> NDArray[np.uint8]:
    """Put keys into the queue, let the session take them out, and return what the window shows."""
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(key)))
    for found in window.presses():
        session.press(found, window.surface)
    session.draw(window.surface)
    window.present()
    return to_array(window.surface)


def test_pause_keeps_the_picture_and_steps_go_there_and_back(window: Window, session: Session) -> None:
    first = press(window, session)
    session.tick(5.0)
    assert (press(window, session) == first).all()
    second = press(window, session, "right")
    assert (second != first).any() and session.player.position == 1
    assert (press(window, session, "right", "left") == second).all()
    assert (press(window, session, "left") == first).all()
    press(window, session, "space")
    session.tick(0.31)
    running = press(window, session)
    assert (running != first).any() and session.player.running
    # On, then to the end and back to the start by other ways: the same pixels.
    assert (press(window, session, "end") != running).any()
    assert (press(window, session, "r", "space") == first).all()


def test_speed(window: Window, session: Session) -> None:
    press(window, session, "up", "space")
    session.tick(0.1)
    faster = session.player.position
    press(window, session, "r", "down", "down")
    session.tick(0.1)
    assert session.player.position < faster


@pytest.mark.parametrize("key", ["a", "t", "s", "h"])
def test_a_look_is_taken_and_left_by_the_same_key(window: Window, session: Session, key: str) -> None:
    before = press(window, session, *["right"] * 3)
    looked = press(window, session, key)
    assert (looked != before).any()
    assert (press(window, session, key) == before).all()


def test_policies_cases_and_episodes_come_in_turn(window: Window, session: Session) -> None:
    def shown() -> tuple[str, str, str]:
        one = session.shows[0]
        return one.title, one.telemetry.case.name, one.episode

    assert shown() == ("keep_course", "4", "1")
    press(window, session, "p")
    assert shown() == ("random", "4", "1")
    drawn_first = session.shows[0].telemetry.actions.tolist()
    press(window, session, "e")
    assert shown() == ("random", "4", "2")
    assert session.shows[0].telemetry.actions.tolist() != drawn_first
    press(window, session, "p", "c")
    title, case, _ = shown()
    assert title == "keep_course" and case != "4"
    seen = {case}
    for _ in range(len(session.playlist.cases) - 1):
        press(window, session, "c")
        seen.add(shown()[1])
    assert shown()[1] == "4" and seen >= {"1", "2", "3", "4", "5", "6", "new"}


def test_a_case_that_a_policy_cannot_sail_is_said_and_passed_over(
    window: Window, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = press(window, session)

    def refuse() -> None:
        raise ConfigError("policy: it cannot")

    monkeypatch.setattr(session.playlist, "shows", refuse)
    after = press(window, session, "c")
    assert session.status == "policy: it cannot" and session.playlist.case.name == "4"
    session.tick(60.0)
    assert (after != before).any() and (press(window, session) == before).all()


def test_the_saved_picture_is_what_is_drawn_for_that_step(window: Window, session: Session) -> None:
    press(window, session, *["right"] * 4, "i", "left", "i", "right", "h", "i")
    saved = sorted(session.folder.iterdir())
    assert [path.name for path in saved] == [
        "case4-keep_course-step03.png",
        "case4-keep_course-step04-2.png",
        "case4-keep_course-step04.png",
    ]
    third, again, fourth = (read(path) for path in saved)
    assert (fourth == again).all() and (third != fourth).any()
    expected = pygame.Surface(SIZE, depth=32)
    session.dashboard.draw(expected, session.shows, 4, session.look)
    assert (to_array(expected) == fourth).all()


def test_the_window_runs_until_it_is_told_to_stop(window: Window, session: Session) -> None:
    for key in ("m", "q"):
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(key)))
    session.run(window)
    assert session.closed
    with Image.open(session.folder / "case4-keep_course-film.gif") as film:
        assert film.size == SIZE and getattr(film, "n_frames", 0) > 20
    session.closed = False
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    session.run(window)
    assert window.closed


def test_a_click_in_a_graph_goes_there(window: Window, session: Session) -> None:
    press(window, session)
    at = {"pos": (SIZE[0] // 4, SIZE[1] - 50), "button": 1}
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, at))
    press(window, session)
    assert 3 < session.player.position < session.player.steps - 3


def test_the_window_may_change_its_size(window: Window, session: Session) -> None:
    pygame.display.set_mode((900, 900), pygame.RESIZABLE)
    assert press(window, session).shape == (900, 900, 3)


def test_two_policies_go_in_step(tmp_path: Path) -> None:
    pair = Session(Playlist([entry("keep_course"), entry("random")], compare=True), tmp_path)
    assert [show.title for show in pair.shows] == ["keep_course", "random"]
    steps = [show.telemetry.steps for show in pair.shows]
    assert pair.player.steps == max(steps)
    with pytest.raises(ConfigError, match="--compare: needs two policies, got keep_course alone"):
        Playlist([entry("keep_course")], compare=True)


def test_policies_with_cases_of_their_own_bring_them(tmp_path: Path) -> None:
    playlist = Playlist([entry("keep_course", "4"), entry("random", "1")])
    playlist.next_policy()
    assert playlist.case.name == "1"
    crossed = Playlist([entry(p, c) for p in ("keep_course", "random") for c in ("1", "4")])
    assert [case.name for case in crossed.cases] == ["1", "4"]
    crossed.next_case()
    crossed.next_policy()
    assert crossed.case.name == "4" and crossed.shows()[0].title == "random"


def test_every_key_that_is_listed_does_something(window: Window, session: Session) -> None:
    names = {"\N{LEFTWARDS ARROW}": "left", "\N{RIGHTWARDS ARROW}": "right", "Esc": "escape"}
    names |= {"\N{UPWARDS ARROW}": "up", "\N{DOWNWARDS ARROW}": "down", "Click": ""}
    listed = [names.get(key, key.lower()) for keys, _ in KEYS for key in keys.replace(",", "").split()]
    # The film is saved by the loop, which shows a message first.
    assert all(key in session.keys or key in ("i", "m") for key in listed if key)
