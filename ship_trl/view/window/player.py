"""The position in an episode that is played: run, pause, step, seek. It knows no window and no clock."""

from __future__ import annotations

from dataclasses import dataclass

# Seconds of the world in one of ours.
SPEEDS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
DEFAULT_SPEED = 5.0


@dataclass
class Player:
    """Plays `steps` steps of `dt` seconds; `position` is in steps, and whole whenever it stands still."""

    steps: int
    dt: float = 1.0
    position: float = 0.0
    running: bool = True
    speed: float = DEFAULT_SPEED

    @property
    def at_end(self) -> bool:
        """Whether nothing is left to play."""
        return self.position >= self.steps

    def advance(self, seconds: float) -> None:
        """Let seconds of ours pass."""
        if self.running:
            self.position = min(self.position + seconds * self.speed / self.dt, float(self.steps))
            self.running = not self.at_end

    def pause(self) -> None:
        """Stop at the step that has begun, or go on; at the end, begin again."""
        if self.running:
            self.seek(int(self.position))
        else:
            self.position = 0.0 if self.at_end else self.position
            self.running = True

    def step(self, count: int = 1) -> None:
        """Stop, and go `count` whole steps on, or back if it is negative."""
        back_from_between = count < 0 and self.position > int(self.position)
        self.seek(int(self.position) + count + back_from_between)

    def seek(self, position: int) -> None:
        """Stop at a step, the nearest there is."""
        self.running = False
        self.position = float(min(max(position, 0), self.steps))

    def restart(self) -> None:
        """Play from the start."""
        self.position, self.running = 0.0, True

    def change_speed(self, levels: int) -> None:
        """Go `levels` up in speed, or down if it is negative, as far as there are any."""
        level = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - self.speed)) + levels
        self.speed = SPEEDS[min(max(level, 0), len(SPEEDS) - 1)]

    def load(self, steps: int, dt: float) -> None:
        """Play another episode from its start, at the same speed."""
        self.steps, self.dt = steps, dt
        self.restart()
