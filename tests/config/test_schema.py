"""Values are read as their types, and an error names the key of a wrong one."""

from typing import Any

import pytest
from omegaconf import OmegaConf

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as
from ship_trl.config.types import plain
from ship_trl.files.record import Evaluation
from tests.config.test_config import HIGH, composed

EVALUATION = {"return": 3, "outcome": "goal", "length": 4, "dcpa": None, "episode": 0}
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "number": ({"seed": 10**400}, "seed: must be less than or equal to 9223372036854775807, got 1000"),
    "list": ({"world": [1]}, "world: must be a group of dt, max_steps, safe_distance,"),
    "row": ({"network": {"conv": [8, 8, 4]}}, "network.conv[0]: must be a valid list, got 8"),
    "key": ({"a\nb": 1}, "a\\nb: unknown key; allowed here: pair,"),
    "pair": ({"pair": "../x"}, 'pair: must be the name of a folder, got "../x"'),
    "surrogate": (
        {"output": "\ud800"},
        "output: must be a path of at most 3000 bytes, 200 a name",
    ),
    "long": ({"output": "a" * 300}, 'output: must be a path of at most 3000 bytes, 200 a name, got "aaa'),
    "itself": ({"output": "${case_base}", "case_base": "${output}"}, "output: Recursive interpolation"),
    "resolved": ({"network": {"conv": "${seed}"}}, "network.conv: must be a valid list, got 0"),
}


@pytest.mark.parametrize("name", WRONG)
def test_the_key_of_a_wrong_value_is_named(name: str) -> None:
    changes, said = WRONG[name]
    values = plain(composed(*HIGH))
    for key, value in changes.items():
        values[key] = values[key] | value if key in ("learn", "network") else value
    with pytest.raises(ConfigError) as caught:
        to_config(OmegaConf.create(values))
    message = str(caught.value)
    assert message.startswith(said) and "\n" not in message and len(message) < 1000


def test_interpolations_and_text_of_the_environment_are_converted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("A_SEED", "7")
    monkeypatch.setenv("A_RATE", "1e-3")
    values = plain(composed(*HIGH)) | {"seed": "${oc.env:A_SEED}", "colour": "yes", "source": 5}
    values["learn"] |= {"lr": "${oc.env:A_RATE}", "update_every": "${learn.batch_size}"}
    config = to_config(OmegaConf.create(values))
    assert (config.seed, config.learn.lr, config.colour, config.source) == (7, 1e-3, True, "5")
    assert config.learn.update_every == config.learn.batch_size
    monkeypatch.setenv("A_SEED", "seven")
    with pytest.raises(ConfigError, match=r'^seed: must be a valid integer, got "seven"$'):
        to_config(OmegaConf.create(values))


def test_values_of_json_are_not_converted_and_may_have_more_keys() -> None:
    found = read_as(Evaluation, EVALUATION | {"later": 1}, from_json=True)
    assert (found.episode_return, found.dcpa) == (3.0, None) and type(found.episode_return) is float
    for change in ({"length": 1.5}, {"length": "1"}, {"length": True}, {"outcome": 1}, {"return": None}):
        (key,) = change
        with pytest.raises(ConfigError, match=f"^result: {key}: must be"):
            read_as(Evaluation, EVALUATION | change, "result: ", from_json=True)
