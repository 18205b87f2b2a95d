"""How large a scene of another tool is at sea, and its lengths, speeds and times there in words. No torch."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from ship_trl.config.bounds import KNOT, NAUTICAL_MILE
from ship_trl.config.types import World


@dataclass(frozen=True)
class Scale:
    """How large a case of another tool is at sea: `length` m a metre, `speed` m/s a m/s.

    `start` (UTC) and `place`, latitude and longitude (degrees) of its origin, are known of some.
    """

    length: float
    speed: float
    start: str = ""
    place: tuple[float, float] | None = None

    @property
    def time(self) -> float:
        """Seconds at sea a second."""
        return self.length / self.speed

    def miles(self, metres: float) -> str:
        """Write a length of the simulator in nautical miles."""
        return f"{metres * self.length / NAUTICAL_MILE:.2f} NM"

    def knots(self, speed: float) -> str:
        """Write a speed (m/s) of the simulator in knots."""
        return f"{speed * self.speed / KNOT:.1f} kn"

    def minutes(self, seconds: float) -> str:
        """Write a time of the simulator in minutes."""
        return f"{seconds * self.time / 60:.0f} min"

    def clock(self, seconds: float) -> str:
        """Write the time (UTC) `seconds` after the start, or the minutes since a start that is unknown."""
        if not self.start:
            return f"+{self.minutes(seconds)}"
        return f"{datetime.fromisoformat(self.start) + timedelta(seconds=seconds * self.time):%H:%M} UTC"

    def describe(self, world: World) -> str:
        """Return the scale in words, in nautical miles and knots."""
        safe, straight = world.safe_distance, world.actions[world.straight_action][0]
        step = f"a step {world.dt * self.time:.0f} s"
        parts = (f"{safe:g} m are {self.miles(safe)}", step, f"own ship {self.knots(straight)}")
        return ", ".join((*parts, f"{self.start[:16]} UTC") if self.start else parts)
