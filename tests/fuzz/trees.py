"""Trees of a configuration, and what damages them."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from tests.fuzz.values import magnitude, scalars, texts, trees


def leaves(values: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """List the places of a tree's leaves and branches."""
    found = [path] if path else []
    if isinstance(values, dict):
        for key, value in values.items():
            found += leaves(value, (*path, key))
    elif isinstance(values, list):
        for index, value in enumerate(values):
            found += leaves(value, (*path, index))
    return found


def put(values: Any, path: tuple[Any, ...], value: Any) -> Any:
    """Copy a tree with one place changed."""
    if not path:
        return value
    copied: Any = dict(values) if isinstance(values, dict) else list(values)
    copied[path[0]] = put(values[path[0]], path[1:], value)
    return copied


@st.composite
def damaged(draw: st.DrawFn, good: Any, most: int = 3) -> Any:
    """A tree with up to so many places replaced, scaled, taken out, or put in under a wrong name."""
    values = good
    for _ in range(draw(st.integers(1, most))):
        places = leaves(values)
        if not places:
            break
        path = draw(st.sampled_from(places))
        match draw(st.sampled_from(["scale", "scale", "scalar", "scalar", "tree", "take", "add"])):
            case "scale":
                old = at(values, path)
                number = type(old) is float or (type(old) is int and abs(old) < 10**12)
                values = put(values, path, draw(magnitude(1e-9, 1e9)) * old if number else draw(scalars))
            case "scalar":
                values = put(values, path, draw(scalars))
            case "tree":
                values = put(values, path, draw(trees))
            case "take":
                above = at(values, path[:-1])
                kept = (
                    {k: v for k, v in above.items() if k != path[-1]}
                    if isinstance(above, dict)
                    else [v for n, v in enumerate(above) if n != path[-1]]
                )
                values = put(values, path[:-1], kept)
            case "add":
                above = at(values, path[:-1])
                more = (
                    {**above, draw(texts): draw(scalars)}
                    if isinstance(above, dict)
                    else [*above, draw(scalars)]
                )
                values = put(values, path[:-1], more)
    return values


def at(values: Any, path: tuple[Any, ...]) -> Any:
    """Find what stands at a place."""
    for key in path:
        values = values[key]
    return values
