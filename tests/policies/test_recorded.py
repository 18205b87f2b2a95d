"""The policy that does what own ship really did."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from ship_trl import make_env
from ship_trl.cli.evaluate import Scored
from ship_trl.config.errors import ConfigError
from ship_trl.policies.named import load_policy, rollout_entry
from ship_trl.policies.registry import Entry
from ship_trl.sim.cases import Case, Suite, load_case, load_world, suite_of
from ship_trl.sim.state import position

WORLD = load_world()


def bent(sign: int) -> Case:
    """Return a case whose own ship turned by 0.06 rad a second, seconds 3 to 8, at full speed."""
    x = y = 0.0
    heading, track = math.pi / 2, []
    for second in range(30):
        heading += sign * 0.06 * (3 <= second < 8)
        x, y = x + 15 * math.cos(heading), y + 15 * math.sin(heading)
        track.append((x, y))
    return replace(load_case("1", WORLD), name=f"bent{sign}", goal=[sign * 10.0, 600], track=tuple(track))


def test_own_ship_is_where_it_was() -> None:
    suite = Suite("s", (bent(1), bent(-1)))
    entry = Entry("recorded", "recorded", suite, WORLD, colour=False)
    env, _, episodes = rollout_entry(entry)
    for case, episode in zip(suite.cases, episodes, strict=True):
        steps = min(len(case.track), episode.length)
        torch.testing.assert_close(
            position(episode.states)[1 : steps + 1], torch.tensor(case.track[:steps]), rtol=0, atol=0.01
        )
        # What it did is told by the table's actions: the first three turn to port, the last to starboard.
        straight, turning = env.world.straight_action, episode.actions[3:8]
        assert bool((turning < straight if case.goal[0] > 0 else turning > straight).all())
        assert int(episode.actions.max()) < len(env.world.actions)


def test_a_table_has_no_time_of_a_decision() -> None:
    suite = Suite("s", (bent(1), bent(-1)))
    entry = Entry("recorded", "recorded", suite, WORLD, colour=False)
    scored = Scored(entry, rollout_entry(entry)[2], math.radians(5))
    assert scored.row(None)[-2] == "-"
    assert [row["decision_ms"] for row in scored.csv_rows()] == ["", ""]


def test_a_case_without_a_track_is_refused() -> None:
    entry = Entry("recorded", "recorded", suite_of(load_case("4", WORLD)), WORLD, colour=False)
    with pytest.raises(ConfigError, match="recorded is known of AIS traffic alone; allowed: target=FILE"):
        rollout_entry(entry)
    with pytest.raises(ConfigError, match="recorded is known of AIS traffic alone"):
        load_policy("recorded", make_env("4", WORLD))
    mixed = replace(entry, suite=Suite("s", (bent(1), load_case("4", WORLD))))
    with pytest.raises(ConfigError, match="recorded is known of AIS traffic alone"):
        rollout_entry(mixed)


def test_it_cannot_be_stepped_by_hand() -> None:
    env = make_env(Suite("s", (bent(1),)), WORLD)
    with pytest.raises(ConfigError, match="recorded decides no single step; allowed: in evaluate, watch"):
        load_policy("recorded", env)
