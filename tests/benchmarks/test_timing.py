"""Interleaving by a clock that the probes themselves move."""

import pytest
from ship_trl.bench.timing import Probe, Timing, measure


def test_probes_take_turns_and_rates_are_units_by_the_clock() -> None:
    now, order = 0.0, []

    def probe(name: str, units: int, takes: float) -> Probe:
        def run() -> int:
            nonlocal now
            now += takes
            order.append(name)
            return units

        return Probe(name, run)

    slow, fast = measure([probe("a", 3, 1.0), probe("b", 1, 0.25)], rounds=2, seconds=0.5, clock=lambda: now)
    # A warm-up of each, then in each round a once (it takes longer) and b until half a second has passed.
    assert order == ["a", "b", *["a", "b", "b"] * 2]
    assert slow.rates == [3.0, 3.0] and fast.rates == [4.0, 4.0]


def test_median_and_spread() -> None:
    timing = Timing(Probe("a", lambda: 1), [5.0, 1.0, 2.0])
    assert (timing.rate, timing.low, timing.high) == (2.0, 1.0, 5.0)


def test_a_failing_probe_is_not_hidden() -> None:
    def run() -> int:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        measure([Probe("a", run)], 1, 0.1)
