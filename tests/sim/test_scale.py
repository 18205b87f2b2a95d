"""Lengths, speeds and times at sea of a scene of another tool."""

from ship_trl.sim.scale import Scale


def test_what_is_written_is_that_of_the_sea() -> None:
    # 45 m stand for 0.3 nautical miles, 15 m/s for 12 knots.
    one = Scale(0.3 * 1852 / 45, 12 * 1852 / 3600 / 15, "2025-06-01 23:50:00+00:00")
    assert (one.miles(45), one.knots(15), one.minutes(60)) == ("0.30 NM", "12.0 kn", "30 min")
    assert (one.clock(0), one.clock(60)) == ("23:50 UTC", "00:20 UTC")
    assert Scale(one.length, one.speed).clock(60) == "+30 min"
