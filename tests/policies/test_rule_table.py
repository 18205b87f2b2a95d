"""What own ship does about engaged ships, on paths made by hand, and the table of it."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
import torch
from torch import Tensor

from ship_trl.policies.metrics import Measurements, measure_episodes, score_rules
from ship_trl.policies.rule_table import HEADINGS, describe_rules, rule_rows
from ship_trl.sim.cases import Case
from ship_trl.sim.state import mirrored_state
from tests.policies.test_metrics import IMAZU, WORLD, episode, track

SIZES = (3, 12, 30, 60)
# A turn of so many degrees takes one step, and straight on is action 0.
TURNS = (0, *SIZES, *(-size for size in SIZES))
WIDE = replace(WORLD, actions=[[15.0, -math.radians(turn)] for turn in TURNS])
HEAD_ON, GIVE_WAY, OVERTAKING, STAND_ON = (IMAZU[number] for number in (1, 2, 3, 4))


def path(case: Case, turn: int, before: int = 0, after: int = 25) -> Tensor:
    """Return states [T + 1, S] of a straight way with one turn (degrees, starboard positive)."""
    return track(WIDE, case, (0, before), (TURNS.index(turn), 1), (0, after))


def measure(*paths: Tensor) -> Measurements:
    return measure_episodes([episode(WIDE, one, [0] * (len(one) - 1)) for one in paths], WIDE)


def first(found: Measurements) -> dict[str, Any]:
    """Return what is known of the first ship of the first episode."""
    cells = {name: values[0, 0].item() for name, values in found.ships.items()}
    return {name: value for name, value in cells.items() if value == value}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("before", [0, 3, 8])
def test_a_head_on_turn_has_side_size_and_range(size: int, before: int) -> None:
    right = path(HEAD_ON, size, before)
    found = first(measure(right))
    assert found == {
        "encounter": "head-on",
        "side": "starboard",
        "turn": pytest.approx(size, abs=1e-3),
        "range": pytest.approx(600 - 30 * before),
        "bow_crossing": 0,
        "obeys": size >= 10,
    }
    mirrored = first(measure(mirrored_state(right)))
    assert mirrored == found | {"side": "port", "bow_crossing": 1, "obeys": 0}


def test_a_kept_course_is_no_action() -> None:
    kept = first(measure(path(GIVE_WAY, 0, after=12)))
    assert kept == {"encounter": "give way", "side": "none", "turn": 0, "bow_crossing": 0, "obeys": 0}
    # So is a correction by half a degree, though the speed falls for it and rises by a quarter after it.
    small = track(WORLD, GIVE_WAY, (4, 1), (3, 11))
    assert first(measure(small)) == kept


def test_give_way_passes_astern_or_crosses_the_bow() -> None:
    astern, ahead = first(measure(path(GIVE_WAY, 60))), first(measure(path(GIVE_WAY, -30)))
    assert (astern["side"], astern["bow_crossing"], astern["obeys"]) == ("starboard", 0, 1)
    assert (ahead["side"], ahead["bow_crossing"], ahead["obeys"]) == ("port", 1, 0)


def test_the_first_action_is_the_one_before_a_larger_one() -> None:
    port, starboard = TURNS.index(-12), TURNS.index(60)
    twice = track(WIDE, HEAD_ON, (0, 2), (port, 1), (0, 7), (starboard, 1), (0, 15))
    found = first(measure(twice))
    assert (found["side"], found["range"], found["obeys"]) == ("port", pytest.approx(540), 0)
    assert found["turn"] == pytest.approx(12, abs=1e-3)
    # Within the time in which a course must be held, both are one action, with the turn of the larger.
    once = track(WIDE, HEAD_ON, (0, 2), (port, 1), (0, 1), (starboard, 1), (0, 15))
    found = first(measure(once))
    assert (found["side"], found["turn"]) == ("starboard", pytest.approx(48, abs=1e-3))


def test_a_turn_in_two_parts_is_one_turn() -> None:
    starboard = TURNS.index(30)
    twice = track(WIDE, HEAD_ON, (0, 2), (starboard, 1), (0, 7), (starboard, 1), (0, 15))
    found = first(measure(twice))
    assert (found["turn"], found["range"]) == (pytest.approx(60, abs=1e-3), pytest.approx(540))


def test_overtaking_asks_for_no_side() -> None:
    for one in (path(OVERTAKING, 30), mirrored_state(path(OVERTAKING, 30))):
        found = first(measure(one))
        assert found["encounter"] == "overtaking" and found["bow_crossing"] == 0 and "obeys" not in found


@pytest.mark.parametrize("turn", [0, *SIZES])
def test_standing_on_keeps_course_until_stage_4(turn: int, make_case: Callable[..., Case]) -> None:
    # Passes 50 m astern, and is first nearer than 67 m after 22 s.
    case = make_case((-371.0, 300.0, 0.0, 15.0))
    early, late = first(measure(path(case, turn, 5))), first(measure(path(case, turn, 23, 10)))
    assert early["encounter"] == "stand on" and early["kept_course"] == (turn == 0)
    assert late["kept_course"] == 1 and {"bow_crossing", "obeys"}.isdisjoint(early)
    slower = track(replace(WIDE, actions=[[15.0, 0.0], [12.0, 0.0]]), case, (0, 5), (1, 25))
    assert (first(measure(slower))["kept_course"], first(measure(slower))["side"]) == (0, "none")


def test_ships_that_are_not_engaged_have_no_action(make_case: Callable[..., Case]) -> None:
    away, anchored = (200.0, -200.0, 270.0, 15.0), (0.0, 400.0, 0.0, 0.0)
    found = measure(path(make_case(away, anchored), 30))
    assert found.ships["encounter"].tolist() == [["none", "none"]]
    assert found.ships["side"].tolist() == [["", ""]]
    assert all(found.known(f"rule_{rule}").size == 0 for rule in (8, 17))
    # Nor has own ship at rest, whatever comes towards it.
    rest = track(replace(WIDE, actions=[[0.0, 0.0]]), HEAD_ON, (0, 20))
    assert score_rules(rest[None, 1:], torch.tensor([len(rest) - 2]), WIDE).onset.item() >= 0
    assert first(measure(rest[1:])) == {"encounter": "none", "side": ""}


def rows(found: Measurements) -> dict[str, dict[str, str]]:
    """Return the table's rows by class of encounter."""
    cells = [dict(zip(HEADINGS[2:], row, strict=True)) for row in rule_rows(found, WIDE.safe_distance)]
    return {one["encounter"]: {key: value for key, value in one.items() if value} for one in cells}


def test_shares_are_of_engaged_ships(make_case: Callable[..., Case]) -> None:
    away = make_case((200.0, -200.0, 270.0, 15.0))
    paths = [path(HEAD_ON, 30), path(HEAD_ON, 12, 5), path(HEAD_ON, -60), path(HEAD_ON, 0, after=12)]
    table = rows(measure(*paths, path(GIVE_WAY, 60), path(STAND_ON, 0), path(away, 0)))
    assert list(table) == ["all", "head-on", "give way", "overtaking", "stand on", "overtaken"]
    assert table["all"]["engaged"] == "6 (86%)" and table["all"]["obeys"] == "60% of 5"
    assert table["head-on"] == {
        "encounter": "head-on",
        "obeys": "50%",
        "engaged": "4 (57%)",
        "starboard action": "50%",
        "turn, degrees": "21",
        "range, m (safe distances)": "600 (13.3)",
        "bow crossings": "50%",
    }
    assert table["stand on"]["kept course"] == "100%" and "bow crossings" not in table["stand on"]
    assert table["overtaken"] == {"encounter": "overtaken", "engaged": "0 (0%)"}


def test_without_ships_nothing_is_engaged(make_case: Callable[..., Case]) -> None:
    table = rows(measure(path(make_case(), 0)))
    assert table["all"]["engaged"] == "0 (0%)" and "obeys" not in table["all"]


def test_selected_episodes_keep_their_ships() -> None:
    found = measure(path(HEAD_ON, 30), path(GIVE_WAY, 30))
    assert found.select(found.ships["encounter"][:, 0] == "give way").ships["encounter"].tolist() == [
        ["give way"]
    ]


def test_bounds_are_those_of_the_world() -> None:
    assert "DCPA below 80 m" in describe_rules(60.0) and "safe distances of 60 m" in describe_rules(60.0)
