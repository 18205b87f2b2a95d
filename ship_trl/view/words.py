"""How numbers, actions and the things of a scene are written in every picture."""

from __future__ import annotations

from ship_trl.config.types import World
from ship_trl.sim import scene

# The paper gives no length: a coaster of 25 m, whose bow stays inside the safe distance.
TRUE_LENGTH = 25.0


def number(value: float, form: str) -> str:
    """Write a number in a format such as `.1f` or `g`, with a true minus sign and none before zero."""
    return format(value, f"z{form}").replace("-", "\N{MINUS SIGN}")


def counted(items: int, what: str) -> str:
    """Write how many of something there are: "no seeds", "1 seed", "2 seeds"."""
    return f"{items or 'no'} {what}{'' if items == 1 else 's'}"


def turn_side(turn: float) -> str:
    """Say to which side a rate of turn leads."""
    return "keep course" if turn == 0 else "to port" if turn > 0 else "to starboard"


def action_text(world: World, action: int) -> str:
    """Describe an action: its speed, and its turn as an arrow with its size."""
    speed, turn = world.actions[action]
    if turn == 0:
        return f"{speed:g} m/s \N{UPWARDS ARROW}"
    port, starboard = "\N{ANTICLOCKWISE OPEN CIRCLE ARROW}", "\N{CLOCKWISE OPEN CIRCLE ARROW}"
    return f"{speed:g} m/s {port if turn > 0 else starboard} {abs(turn):g}"


def circle_names(world: World) -> tuple[str, str]:
    """Name the red and the black circle."""
    return f"expected distance {world.goal_distance:g} m", f"safe distance {world.safe_distance:g} m"


def hull_lengths(to_scale: bool) -> str:
    """Say how long the ships are drawn."""
    if to_scale:
        return f"hulls to scale, {TRUE_LENGTH:g} m; outline: as drawn for the network"
    drawn = f"{scene.OWN_LENGTH:g} and {scene.TARGET_LENGTH:g} m"
    return f"hulls larger than life: {drawn}, truly {TRUE_LENGTH:g} m"
