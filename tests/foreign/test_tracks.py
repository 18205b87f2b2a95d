"""From positions to encounters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ship_trl.config.bounds import KNOT
from ship_trl.config.types import OwnShip
from ship_trl.foreign import tracks as tracks_module
from ship_trl.foreign.tracks import Found, Limits, find_encounters, resample
from tests.formats.traffic import (
    CROSSING,
    HEAD_ON,
    LATITUDE,
    LONGITUDE,
    SLOW_CROSSING,
    START,
    Track,
    danish,
    make,
    read_frame,
)

# About what 0.3 nautical miles as 45 m make of the world's limits, at 12 knots.
LIMITS = Limits(dcpa=741, tcpa=898, clear=1111, window=7902)


def find(rows: pandas.DataFrame, own: OwnShip = OwnShip.gives_way, ships: int = 3) -> Found:
    return find_encounters(read_frame(danish(rows)), LIMITS, own, ships)


def test_the_ship_that_gives_way_is_own_ship_from_the_first_moment_on() -> None:
    found = find(make(CROSSING))
    (situation,) = found.situations
    assert (found.pairs, found.encounters) == (1, 1)
    # 600 s before they meet, which is when the table begins.
    assert situation.start is not None and situation.start.timestamp() == START
    assert situation.own.course == pytest.approx(0, abs=0.1) and situation.own.speed == pytest.approx(
        12 * KNOT, rel=1e-3
    )
    (target,) = situation.targets
    assert (target.x, target.y) == pytest.approx((3704, 3704), abs=5) and target.course == pytest.approx(
        270, abs=0.1
    )


def test_own_ship_can_be_the_one_that_stands_on_or_both() -> None:
    (situation,) = find(make(CROSSING), OwnShip.stands_on).situations
    assert situation.own.course == pytest.approx(270, abs=0.1)
    assert len(find(make(CROSSING), OwnShip.both).situations) == 2
    # Head-on both give way.
    assert len(find(make(HEAD_ON)).situations) == 2


def test_an_encounter_begins_when_it_is_soon_enough() -> None:
    far = (CROSSING[0], Track(2 * 3704, 2 * 3704, 270, 12))
    (situation,) = find(make(far, minutes=30)).situations
    assert situation.start is not None
    assert situation.start.timestamp() - START == pytest.approx(1200 - LIMITS.tcpa, abs=30)


@pytest.mark.parametrize(
    "tracks",
    [
        # Moored side by side; a convoy; a crossing that passes at two miles; one that is over.
        (Track(0, 0, 0, 0), Track(100, 0, 0, 0)),
        (Track(0, 0, 0, 12), Track(0, 1000, 0, 12)),
        (Track(0, 0, 0, 12), Track(3704 + 3704, 3704, 270, 12)),
        (Track(0, 0, 0, 12), Track(0, -1500, 180, 12)),
    ],
)
def test_nearness_alone_is_no_encounter(tracks: tuple[Track, ...]) -> None:
    found = find(make(tracks))
    assert found.encounters == 0 and found.pairs == 1


def test_a_pair_is_one_encounter_however_long() -> None:
    assert find(make(HEAD_ON, minutes=40)).encounters == 1


@pytest.mark.parametrize(("silence", "encounters"), [(400, 1), (3600, 2)])
def test_a_pair_out_of_sight_for_long_can_meet_again(silence: int, encounters: int) -> None:
    # The first time they are lost before they meet.
    before, after = make(CROSSING, minutes=2), make(CROSSING, minutes=8)
    found = find(pandas.concat((before, after.assign(time=after.time + 120 + silence))))
    assert (found.pairs, found.encounters, len(found.situations)) == (1, encounters, encounters)


def test_an_encounter_of_a_slow_own_ship_is_counted_and_left_out() -> None:
    found = find(make(SLOW_CROSSING))
    assert (found.encounters, found.slow, found.situations) == (1, 1, [])


def test_an_encounter_that_a_track_begins_too_late_is_counted_and_left_out() -> None:
    late = make((CROSSING[0], Track(741, 741, 270, 12)))
    limits = LIMITS._replace(soonest=240.0)
    for rows, encounters in ((late, (1, 1, 0)), (make(CROSSING), (1, 0, 1))):
        found = find_encounters(read_frame(danish(rows)), limits, OwnShip.gives_way, 3)
        assert (found.encounters, found.late, len(found.situations)) == encounters
    assert len(find(late).situations) == 1


def test_no_place_is_made_up_across_a_gap() -> None:
    rows = make(CROSSING, minutes=20)
    gap = (rows.time > START + 120) & (rows.time < START + 120 + 400)
    instants = resample(read_frame(danish(rows[~gap])), 30).instant - START
    assert set(instants) & set(range(150, 510, 30)) == set() and 120 in instants and 540 in instants


def test_a_fix_at_a_wrong_place_makes_no_speed() -> None:
    rows = make(CROSSING, minutes=10)
    rows.loc[20, "lat"] += 0.5
    samples = resample(read_frame(danish(rows)), 30)
    assert np.hypot(*samples.motion.T).max() < 13 * KNOT


def test_a_course_through_north_stays_there() -> None:
    rows = make([Track(0, 0, 359, 12, turns_at=60, turns_by=2)], minutes=3)
    samples = resample(read_frame(danish(rows)), 5)
    course = np.degrees(np.arctan2(*samples.motion.T))
    assert np.abs(course).max() < 2


@given(st.floats(0, 359), st.floats(3, 25), st.booleans())
@settings(max_examples=25)
def test_a_straight_track_is_resampled_exactly(course: float, knots: float, has_courses: bool) -> None:
    rows = make([Track(0, 0, course, knots)], minutes=3)
    if not has_courses:
        rows["cog"] = 360.0
    samples = resample(read_frame(danish(rows)), 7)
    speed = np.hypot(*samples.motion.T)
    np.testing.assert_allclose(speed, knots * KNOT, rtol=0.03)
    first, last = samples.instant[[0, -1]] - START
    way = math.radians(LATITUDE) and (samples.place[-1, 1] - samples.place[0, 1]) * 111_344
    assert way == pytest.approx((last - first) * knots * KNOT * math.cos(math.radians(course)), abs=5)


# Ships that come near each other, some of which turn.
TRACKS = st.lists(
    st.builds(
        Track,
        x=st.integers(-4000, 4000),
        y=st.integers(-4000, 4000),
        course=st.integers(0, 359),
        knots=st.integers(4, 20),
        turns_at=st.sampled_from([120, 300, math.inf]),
        turns_by=st.sampled_from([0, 30, -30]),
    ),
    min_size=2,
    max_size=4,
    unique_by=lambda track: (track.x // 500, track.y // 500),
)


@given(TRACKS, st.randoms(use_true_random=False))
@settings(max_examples=10, deadline=None)
def test_rows_in_any_order_give_the_same_encounters(tracks: list[Track], random: Any) -> None:
    rows = make(tracks, minutes=10)
    order = list(range(len(rows)))
    random.shuffle(order)
    assert find(rows.iloc[order], OwnShip.both) == find(rows, OwnShip.both)


@given(TRACKS)
@settings(max_examples=10, deadline=None)
def test_mirrored_tracks_give_mirrored_encounters(tracks: list[Track]) -> None:
    rows = make(tracks, minutes=10).round({"lon": 6, "cog": 1})
    mirrored = rows.assign(lon=2 * LONGITUDE - rows.lon, cog=-rows.cog % 360)
    one, other = (find(table, OwnShip.both) for table in (rows, mirrored))
    assert (one.encounters, one.pairs, one.turned) == (other.encounters, other.pairs, other.turned)
    for right, left in zip(one.situations, other.situations, strict=True):
        assert (right.name, right.start) == (left.name, left.start)
        for ship, turned in zip((right.own, *right.targets), (left.own, *left.targets), strict=True):
            assert (ship.x, ship.y, ship.speed) == pytest.approx((-turned.x, turned.y, turned.speed), abs=2)
            assert math.remainder(ship.course + turned.course, 360) == pytest.approx(0, abs=0.5)


def test_a_table_is_the_same_in_pieces_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = make((*CROSSING, Track(-2000, 4000, 90, 8, 600, 30)), minutes=50)
    whole = find(rows, OwnShip.both)
    monkeypatch.setattr(tracks_module, "PIECE", 300)
    assert find(rows, OwnShip.both) == whole and whole.encounters > 0


def test_other_ships_join_nearest_first() -> None:
    others = [Track(500 * n, -3000, 180, 3) for n in (4, 1, 2)]
    (situation,) = find(make((*CROSSING, *others), minutes=12), ships=3).situations
    assert [round(ship.x, -2) for ship in situation.targets] == [3700, 500, 1000]


def test_turned_ships_are_counted_and_own_track_is_kept() -> None:
    tracks = (CROSSING[0]._replace(turns_at=300, turns_by=40), CROSSING[1])
    found = find(make(tracks), OwnShip.both)
    # As a target ship, the one that turned is told.
    assert (found.ships, found.turned) == (2, 1)
    track = found.situations[0].own.track
    assert track is not None and track[:, 0].tolist() == list(range(0, 1201, 30))
    assert np.abs(track[10, 1:]).max() == pytest.approx(300 * 12 * KNOT, rel=0.01)


def test_the_track_of_a_slow_own_ship_is_kept_for_its_whole_episode() -> None:
    slow = [track._replace(knots=track.knots / 3, x=track.x / 3, y=track.y / 3) for track in CROSSING]
    (situation,) = find(make(slow, minutes=60)).situations
    track = situation.own.track
    assert track is not None and track[-1, 0] > 1800


def test_positions_lie_where_the_table_says() -> None:
    samples = resample(read_frame(danish(make(CROSSING[:1], minutes=2))), 30)
    assert samples.place[0] == pytest.approx((LONGITUDE, LATITUDE))


def test_an_empty_table_has_no_encounter() -> None:
    assert find(make(CROSSING).iloc[:0]).situations == []
