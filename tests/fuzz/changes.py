"""Changes of a file that keep its form: a value of JSON or YAML, or a cell of a table, becomes another."""

from __future__ import annotations

import json
from random import Random
from typing import Any

import yaml

from tests.fuzz.trees import at, leaves, put

VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 7, 2**31, 2**63, 10**30, 10**400, 0.5, -0.0, 1e308, 1e-320, float("nan")),
    *(
        float("inf"),
        "",
        "a",
        "a\nb",
        "${heading}",
        "${nothing}",
        "???",
        "NaN",
        "1e400",
        "../x",
        "\ud800",
        [],
        [[]],
    ),
    *({}, [1], {"a": 1}, [0] * 50, "a" * 500),
)
CELLS = ("", "nan", "inf", "1e400", "-1", "1.5", "x", '"', "9" * 30, "goal", "4", "0")


def change(content: bytes, random: Random) -> bytes | None:
    """Change one place, or return None for what has no form."""
    try:
        text = content.decode()
    except UnicodeDecodeError:
        return None
    try:
        if text.startswith("{"):
            return json.dumps(changed(json.loads(text), random)).encode()
        if text.startswith("episode,"):
            rows = [line.split(",") for line in text.split("\n")]
            row = random.choice(rows)
            row[random.randrange(len(row))] = random.choice(CELLS)
            return "\n".join(map(",".join, rows)).encode()
        if text.count("*") < 3:
            return yaml.safe_dump(changed(yaml.safe_load(text), random)).encode("utf-8", "surrogatepass")
    except (ValueError, RecursionError, yaml.YAMLError, LookupError, TypeError, AttributeError):
        pass
    return None


def changed(tree: Any, random: Random) -> Any:
    """Replace one place of a tree by a value or another of its branches, or take it out."""
    places = leaves(tree)
    if not places:
        return random.choice(VALUES)
    path = random.choice(places)
    match random.randrange(4):
        case 0:
            return put(tree, path, at(tree, random.choice(places)))
        case 1:
            above = at(tree, path[:-1])
            kept: Any = (
                {key: value for key, value in above.items() if key != path[-1]}
                if isinstance(above, dict)
                else [value for n, value in enumerate(above) if n != path[-1]]
            )
            return put(tree, path[:-1], kept)
    return put(tree, path, random.choice(VALUES))
