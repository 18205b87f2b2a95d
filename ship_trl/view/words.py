"""How pictures write numbers, actions and the parts of a scene."""

from __future__ import annotations

from ship_trl.config.types import World


def number(value: float, form: str) -> str:
    """Format a number with a true minus sign, and without one before zero."""
    return format(value, f"z{form}").replace("-", "\N{MINUS SIGN}")


def counted(items: int, noun: str) -> str:
    """Write a count: "no seeds", "1 seed", "2 seeds"."""
    return f"{items or 'no'} {noun}{'' if items == 1 else 's'}"


def action_text(world: World, action: int) -> str:
    """Write the speed of an action, and its turn as an arrow with its size."""
    speed, turn = world.actions[action]
    if turn == 0:
        return f"{speed:g} m/s \N{UPWARDS ARROW}"
    port, starboard = "\N{ANTICLOCKWISE OPEN CIRCLE ARROW}", "\N{CLOCKWISE OPEN CIRCLE ARROW}"
    return f"{speed:g} m/s {port if turn > 0 else starboard} {abs(turn):g}"


def circle_names(world: World) -> tuple[str, str]:
    """Name the circle around the goal, and the one around own ship."""
    return f"expected distance {world.goal_distance:g} m", f"safe distance {world.safe_distance:g} m"
