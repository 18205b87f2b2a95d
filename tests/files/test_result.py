"""What a result is: written and read the same, and refused by the key that is wrong."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.files.record import (
    SCHEMA_VERSION,
    RunError,
    SourceReturns,
    from_json,
)
from tests.a_result import a_result, an_evaluation


@given(
    number=st.floats(allow_nan=False, allow_infinity=False),
    layers=st.one_of(st.none(), st.integers(1, 4), st.just("all")),
    dcpa=st.one_of(st.none(), st.floats(0, 1e6)),
    draws=st.lists(st.floats(-1e6, 1e6), max_size=3),
)
def test_it_is_read_as_it_was_written(number: float, layers: Any, dcpa: Any, draws: list[float]) -> None:
    score = an_evaluation(number)
    made = a_result(layers=layers, best=score, draws=draws, best_known_return=number)
    object.__setattr__(score, "dcpa", dcpa)
    assert from_json(json.loads(json.dumps(made.to_json()))) == made


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"pair": None}, "pair: must be a valid string, got null"),
        ({"seed": "0"}, 'seed: must be a valid integer, got "0"'),
        ({"seed": True}, "seed: must be a valid integer, got true"),
        ({"best_known_return": "80"}, 'best_known_return: must be a valid number, got "80"'),
        ({"best_known_return": float("inf")}, "best_known_return: must be a finite number, got Infinity"),
        ({"draws": [1.0, "2"]}, r"draws\[1\]: must be a valid number, got \"2\""),
        ({"best": 3}, "best: must be a group of episode_return, outcome,"),
        ({"best": {"return": 1.0}}, "best.outcome: missing"),
        ({"best": {"outcome": "goal"}}, "best.return: missing"),
        ({"schema_version": SCHEMA_VERSION + 1}, f"has schema_version {SCHEMA_VERSION + 1}; only 3"),
        ({"schema_version": "3"}, "has schema_version '3'; only 3"),
    ],
)
def test_a_wrong_value_is_named(change: dict[str, Any], said: str) -> None:
    with pytest.raises(RunError, match=said):
        from_json(a_result().to_json() | change)


def test_returns_on_the_source_are_read_again_and_may_be_missing() -> None:
    source = SourceReturns(83.9, -300.0, 20.5, -10.0, -203.3, None)
    result = a_result(on_source=source)
    values = json.loads(json.dumps(result.to_json()))
    assert from_json(values) == result
    del values["on_source"]
    assert from_json(values).on_source is None
