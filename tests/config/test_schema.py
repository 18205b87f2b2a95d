"""Values are read as their types, and an error names the key of a wrong one."""

from typing import Any

import pytest
from omegaconf import OmegaConf

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as
from ship_trl.config.types import plain
from ship_trl.files.result import Evaluation
from tests.config.test_config import HIGH, composed

HUGE = 10**400
EVALUATION = {"return": 3, "outcome": "goal", "length": 4, "dcpa": None, "episode": 0}
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
    "text": ({"output": 1000.0}, "output: must be plain text, in quotes, got 1000.0"),
    "device": ({"device": "cuda:x"}, "device: must be cpu or cuda, got cuda:x"),
}


@pytest.mark.parametrize("name", WRONG)
def test_the_key_of_a_wrong_value_is_named(name: str) -> None:
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


def test_text_of_the_environment_is_converted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("A_SEED", "7")
    monkeypatch.setenv("A_RATE", "1e-3")
    values = plain(composed(*HIGH)) | {"seed": "${oc.env:A_SEED}", "colour": "yes", "source": 5}
    values["learn"]["lr"] = "${oc.env:A_RATE}"
    config = to_config(OmegaConf.create(values))
    assert (config.seed, config.learn.lr, config.colour, config.source) == (7, 1e-3, True, "5")
    monkeypatch.setenv("A_SEED", "seven")
    with pytest.raises(ConfigError, match=r"^seed: must be a whole number, got seven$"):
        to_config(OmegaConf.create(values))


def test_values_of_json_are_not_converted_and_may_have_more_keys() -> None:
    found = read_as(Evaluation, EVALUATION | {"later": 1}, from_json=True)
    assert (found.episode_return, found.dcpa) == (3.0, None) and type(found.episode_return) is float
    for change in ({"length": 1.0}, {"length": "1"}, {"length": True}, {"outcome": 1}, {"return": None}):
        (key,) = change
        with pytest.raises(ConfigError, match=f"^result: {key}: must be"):
            read_as(Evaluation, EVALUATION | change, "result: ", from_json=True)
