"""Which calls are captured as graphs; a double stands for the GPU (tests/test_gpu.py has the real one)."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

from ship_trl.fast import graphs
from ship_trl.fast.graphs import EAGER_CALLS, MAX_GRAPHS, MAX_ROWS, Captured


@pytest.fixture
def captures(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """Return the shapes that are captured, in a process without a GPU."""
    found: list[tuple[int, ...]] = []

    def capture(function: Any, inputs: tuple[Tensor, ...]) -> Any:
        found.append(tuple(inputs[0].shape))
        return lambda *given: function(*given) + 100

    monkeypatch.setattr(torch.cuda, "is_current_stream_capturing", lambda: False)
    monkeypatch.setattr(graphs, "run_aside", lambda function, inputs: function(*inputs))
    monkeypatch.setattr(graphs, "Graph", capture)
    return found


def test_a_shape_is_captured_after_its_first_calls(captures: list[tuple[int, ...]]) -> None:
    double = Captured(lambda x: 2 * x)
    for size in (3, 4):
        found = [double(torch.ones(size)).tolist() for _ in range(EAGER_CALLS + 2)]
        assert found == EAGER_CALLS * [size * [2.0]] + 2 * [size * [102.0]]
    assert captures == [(3,), (4,)]


def test_large_inputs_and_further_shapes_are_not_captured(captures: list[tuple[int, ...]]) -> None:
    double = Captured(lambda x: 2 * x)
    for size in (MAX_ROWS + 1, *range(1, MAX_GRAPHS + 2)):
        for _ in range(EAGER_CALLS + 1):
            double(torch.ones(size))
    assert captures == [(size,) for size in range(1, MAX_GRAPHS + 1)]


def test_within_a_capture_the_function_itself_is_called(
    captures: list[tuple[int, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    double = Captured(lambda x: 2 * x)
    monkeypatch.setattr(torch.cuda, "is_current_stream_capturing", lambda: True)
    assert [double(torch.ones(1)).item() for _ in range(EAGER_CALLS + 2)] == (EAGER_CALLS + 2) * [2.0]
    assert captures == []
