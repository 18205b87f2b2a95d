"""CUDA graphs: hundreds of small operations on a GPU as one launch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import Any

import torch
from torch import Tensor
from torch.utils import _pytree as pytree

# Calls of each shape before the capture: libraries allocate what they keep, and rare shapes need no graph.
EAGER_CALLS = 10
# A graph keeps the memory of all its operations. Large inputs keep a GPU busy without one.
MAX_ROWS, MAX_GRAPHS = 4096, 16


class Captured:
    """A function of tensors on a GPU, replayed as one CUDA graph for each shape of its inputs.

    `captured(*inputs)` returns new tensors, as the function does. The function must do the same operations
    for all inputs of a shape, read no value on the host, and draw no random numbers. Python numbers that it
    uses are kept. It may change memory that stays where it is, such as weights.

    Args:
        function: takes tensors [N, ...] and returns tensors.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._calls: Counter[tuple[torch.Size, ...]] = Counter()
        self._graphs: dict[tuple[torch.Size, ...], Graph] = {}

    def __call__(self, *inputs: Tensor) -> Any:
        """Compute the function."""
        if torch.cuda.is_current_stream_capturing():  # within another captured function
            return self._function(*inputs)
        shapes = tuple(one.shape for one in inputs)
        graph = self._graphs.get(shapes)
        if graph is not None:
            return graph(*inputs)
        if len(inputs[0]) > MAX_ROWS or len(self._graphs) == MAX_GRAPHS:
            return self._function(*inputs)
        self._calls[shapes] += 1
        if self._calls[shapes] <= EAGER_CALLS:
            return run_aside(self._function, inputs)
        self._graphs[shapes] = Graph(self._function, inputs)
        return self._graphs[shapes](*inputs)


@cache
def side_stream(device: torch.device) -> torch.cuda.Stream:
    """Return the stream of all captures on a GPU."""
    return torch.cuda.Stream(device)


def run_aside(function: Callable[..., Any], inputs: tuple[Tensor, ...]) -> Any:
    """Compute a function on the stream of captures.

    Autograd remembers the stream of a weight's first gradient, and a capture must not meet another stream.
    """
    device = inputs[0].device
    stream, current = side_stream(device), torch.cuda.current_stream(device)
    stream.wait_stream(current)
    with torch.cuda.stream(stream):
        found = function(*inputs)
    current.wait_stream(stream)
    return found


class Graph:
    """One capture of a function, and the memory of its inputs and results."""

    def __init__(self, function: Callable[..., Any], inputs: tuple[Tensor, ...]) -> None:
        device = inputs[0].device
        self._inputs = [one.clone() for one in inputs]
        self._graph = torch.cuda.CUDAGraph()
        with torch.cuda.device(device), torch.cuda.graph(self._graph, stream=side_stream(device)):
            found = function(*self._inputs)
        self._results, self._structure = pytree.tree_flatten(found)

    def __call__(self, *inputs: Tensor) -> Any:
        """Copy the inputs in, replay, and copy the results out: the next replay overwrites them."""
        for own, given in zip(self._inputs, inputs, strict=True):
            own.copy_(given)
        self._graph.replay()
        return pytree.tree_unflatten([result.clone() for result in self._results], self._structure)
