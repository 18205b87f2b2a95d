"""Lists, groups and single values stand where they should, and a complaint says where they do not."""

from typing import Any

import pytest
from omegaconf import OmegaConf

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import plain
from tests.config.test_config import HIGH, composed

HUGE = 10**400
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "number": ({"seed": HUGE}, "seed: must be at most 9223372036854775807 in size, got 1000"),
    "digits": (
        {"seed": 10**5000},
        "seed: must be at most 9223372036854775807 in size, got an integer of thousa",
    ),
    "float": ({"learn": {"lr": HUGE}}, "learn.lr: must be at most 9223372036854775807 in size, got 1000"),
    "inner": ({"world": {"actions": [[1.0, HUGE]]}}, "world.actions[0][1]: must be at most 92233"),
    "list": ({"world": [1]}, "world: must be a group of dt, max_steps, safe_distance,"),
    "group": ({"seed": {"a": 1}}, "seed: must be a whole number, got {'a': 1}"),
    "lists": ({"network": {"conv": 8}}, "network.conv: must be a list of lists, as [["),
    "truth": ({"network": {"conv": [[8, 84, True]]}}, "network.conv[0][2]: must be a whole number, got true"),
    "row": ({"network": {"conv": [8, 8, 4]}}, "network.conv[0]: must be a list, as [A,B] or []"),
    "key": ({"a\nb": 1}, "a\\nb: unknown key; allowed here: pair,"),
    "pair": ({"pair": "../x"}, "pair: must be the name of a folder, got ../x"),
    "surrogate": (
        {"output": "\ud800"},
        "output: must be a path of at most 3000 bytes, 200 a name, got \\ud8",
    ),
    "zero": ({"output": "a\0b"}, "output: must be a path of at most 3000 bytes, 200 a name, got a\\x00b"),
    "long": ({"output": "a" * 300}, "output: must be a path of at most 3000 bytes, 200 a name, got aaa"),
    "deep": ({"output": "a/" * 2000}, "output: must be a path of at most 3000 bytes, 200 a name, got a/"),
    "itself": ({"output": "${case_base}", "case_base": "${output}"}, "output: Recursive interpolation"),
    "resolved": ({"network": {"conv": "${seed}"}}, "network.conv: must be a list of lists, as [["),
    "device": ({"device": "cuda:x"}, "device: must be cpu or cuda, got cuda:x"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_stands_elsewhere_is_named(name: str) -> None:
    changes, said = WRONG[name]
    values = plain(composed(*HIGH))
    for key, value in changes.items():
        values[key] = (
            {**values[key], **value} if isinstance(value, dict) and key in ("learn", "network") else value
        )
        if key == "world" and isinstance(value, dict):
            values[key] = {**plain(composed(*HIGH).world), **value}
    with pytest.raises(ConfigError) as caught:
        to_config(OmegaConf.create(values))
    message = str(caught.value)
    assert message.startswith(said) and "\n" not in message and len(message) < 1000


def test_a_value_may_be_an_interpolation() -> None:
    values = plain(composed(*HIGH)) | {"seed": "${learn.batch_size}"}
    assert to_config(OmegaConf.create(values)).seed == values["learn"]["batch_size"]
