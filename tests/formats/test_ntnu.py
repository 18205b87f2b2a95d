"""Scenarios of NTNU's colav_simulator."""

from __future__ import annotations

from typing import Any

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.formats.ntnu import read_scenario
from ship_trl.formats.situation import Ship


def ship(*state: float, **more: Any) -> dict[str, Any]:
    return {"csog_state": list(state), **more}


def test_states_are_north_east_speed_and_course() -> None:
    ships = [ship(1000, 500, 10, 0, waypoints=[[1000, 3000], [500, 700]]), ship(1200, 800, 5, -90)]
    found = read_scenario({"ship_list": ships}, "one")
    assert found.own == Ship(0, 0, 0, 10)
    assert found.targets == (Ship(300, 200, 270, 5),)
    # All norths, then all easts.
    assert found.goal == (200, 2000)


def test_a_goal_state_counts_before_waypoints() -> None:
    own = ship(0, 0, 10, 0, waypoints=[[0, 1], [0, 1]], goal_csog_state=[900, 50, 0, 0])
    assert read_scenario({"ship_list": [own]}, "one").goal == (50, 900)


def test_a_target_ship_that_turns_is_noted() -> None:
    turning = ship(0, 900, 5, 0, waypoints=[[0, 100, 100], [900, 900, 1000]])
    assert read_scenario({"ship_list": [ship(0, 0, 9, 0), turning]}, "one").notes != ()


@pytest.mark.parametrize(
    ("ships", "message"),
    [
        ([], "ship_list: must be a list of ships, own ship first, got"),
        (3, "ship_list: must be a valid array"),
        ([ship(0, 0, 1)], r"ship_list\[0\].csog_state\[3\]: missing"),
        ([ship(0, 0, 0, 0)], "own ship is at rest"),
        ([ship(0, 0, 1, 0), ship(0, 0, -1, 0)], r"ship_list\[1\].csog_state\[2\]: must be greater than"),
        ([ship(0, 0, 1, 0, waypoints=[[0, 1]])], r"ship_list\[0\].waypoints\[1\]: missing"),
        ([ship(0, 0, 1, 0, waypoints=[[0, 1], [0]])], "has 2 norths and 1 easts"),
    ],
)
def test_a_wrong_scenario_is_refused_by_its_key(ships: Any, message: str) -> None:
    with pytest.raises((ValueError, ConfigError), match=message):
        read_scenario({"ship_list": ships}, "one")
