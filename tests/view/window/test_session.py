"""Watching policies: a real SDL window, real events in its queue, and the pictures that follow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray
from PIL import Image

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Perturbation
from ship_trl.policies.entry import split_suites
from ship_trl.view import pen
from ship_trl.view.dashboard import draw_dashboard
from ship_trl.view.window.session import Session
from tests.view.episodes import entry, post, press

SIZE = (1120, 630)
pytestmark = pytest.mark.usefixtures("window")


@pytest.fixture
def session(tmp_path: Path) -> Session:
    policies = [entry("keep_course"), entry("random")]
    made = Session(policies, folder=tmp_path / "saved")
    made.pause()
    return made


def read(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as opened:
        return np.asarray(opened).copy()


def test_pause_keeps_the_picture_and_steps_go_there_and_back(session: Session) -> None:
    first = press(session)
    session.tick(5.0)
    assert (press(session) == first).all()
    second = press(session, "right")
    assert (second != first).any() and session.position == 1
    assert (press(session, "right", "left") == second).all()
    assert (press(session, "left") == first).all()
    press(session, "up", "up", "down", "space")
    session.tick(0.31)
    assert session.position == pytest.approx(3.1)
    running = press(session)
    assert (running != first).any() and session.is_running
    # On, then to the end and back to the start by other ways: the same pixels.
    assert (press(session, "end") != running).any()
    assert (press(session, "r", "space", "down") == first).all()


def test_a_suite_is_shown_case_by_case_and_perturbed_starts_are_drawn_again(tmp_path: Path) -> None:
    one = entry("keep_course", "paper")
    entries = split_suites([replace(one, suite=replace(one.suite, perturbation=Perturbation(9.0)))])
    made = Session(entries, folder=tmp_path)
    assert [case.name for case in made.cases] == ["1", "2", "3", "4", "5", "6", "new"]
    first = made.views[0].telemetry
    assert first.case.name == "1"
    made.next_episode()
    again = made.views[0].telemetry
    assert (first.states[0] != again.states[0]).any() and again.case.name == "1"
    made.next_case()
    assert made.views[0].telemetry.case.name == "2"


@pytest.mark.parametrize("key", ["a", "t", "s", "h"])
def test_a_look_is_taken_and_left_by_the_same_key(session: Session, key: str) -> None:
    before = press(session, *["right"] * 3)
    looked = press(session, key)
    assert (looked != before).any()
    assert (press(session, key) == before).all()


def test_policies_cases_and_episodes_come_in_turn(session: Session) -> None:
    def shown() -> tuple[str, str]:
        one = session.views[0]
        return one.title, one.telemetry.case.name

    assert shown() == ("keep_course", "4")
    press(session, "p")
    assert shown() == ("random", "4")
    drawn_first = session.views[0].telemetry.actions.tolist()
    press(session, "e")
    assert shown() == ("random, episode 2", "4")
    assert session.views[0].telemetry.actions.tolist() != drawn_first
    press(session, "p", "c")
    title, case = shown()
    assert title == "keep_course, episode 2" and case != "4"
    seen = {case}
    for _ in range(len(session.cases) - 1):
        press(session, "c")
        seen.add(shown()[1])
    assert shown()[1] == "4" and seen >= {"1", "2", "3", "4", "5", "6", "new"}


def test_a_case_that_a_policy_cannot_run_is_reported_and_skipped(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = press(session)

    def refuse(*_: object) -> None:
        raise ConfigError("policy: it cannot")

    monkeypatch.setattr("ship_trl.view.window.session.view_entry", refuse)
    after = press(session, "c")
    assert session.status == "policy: it cannot" and session.case.name == "4"
    assert (after != before).any() and (press(session, "home", "space") == before).all()


def test_the_saved_picture_is_what_is_drawn_for_that_step(session: Session) -> None:
    press(session, *["right"] * 4, "i", "left", "i", "right", "h", "i")
    saved = sorted(session.folder.iterdir())
    assert [path.name for path in saved] == [
        "case4-keep_course-step03.png",
        "case4-keep_course-step04-2.png",
        "case4-keep_course-step04.png",
    ]
    third, again, fourth = (read(path) for path in saved)
    assert (fourth == again).all() and (third != fourth).any()
    expected = pen.new_surface(*SIZE)
    draw_dashboard(expected, session.views, 4, session.look)
    assert (pen.to_array(expected) == fourth).all()


def test_the_window_runs_until_it_is_told_to_stop(session: Session) -> None:
    post("m", "q")
    session.run()
    assert session.is_closed
    with Image.open(session.folder / "case4-keep_course-film.gif") as film:
        assert film.size == SIZE and getattr(film, "n_frames", 0) > 20
    session.is_closed = False
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    session.run()
    assert session.is_closed


def test_a_click_in_a_graph_goes_there(session: Session) -> None:
    press(session)
    at = {"pos": (SIZE[0] // 4, SIZE[1] - 50), "button": 1}
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, at))
    press(session)
    assert 3 < session.position < session.steps - 3


def test_the_window_may_change_its_size(session: Session) -> None:
    pygame.display.set_mode((900, 900), pygame.RESIZABLE)
    assert press(session).shape == (900, 900, 3)


def test_two_policies_go_in_step() -> None:
    pair = Session([entry("keep_course"), entry("random")], compare=True)
    assert [view.title for view in pair.views] == ["keep_course", "random"]
    steps = [view.telemetry.steps for view in pair.views]
    assert pair.steps == max(steps)
    with pytest.raises(ConfigError, match="--compare: needs two policies, got keep_course alone"):
        Session([entry("keep_course")], compare=True)


def test_policies_with_cases_of_their_own_bring_them() -> None:
    own = Session([entry("keep_course", "4"), entry("random", "1")])
    own.next_policy()
    assert own.case.name == "1"
    crossed = Session([entry(p, c) for p in ("keep_course", "random") for c in ("1", "4")])
    assert [case.name for case in crossed.cases] == ["1", "4"]
    crossed.next_case()
    crossed.next_policy()
    assert crossed.case.name == "4" and crossed.views[0].title == "random"
