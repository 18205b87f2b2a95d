"""CUDA graphs: hundreds of small operations on a GPU as one launch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.utils import _pytree as pytree

# Calls of each shape before the capture, in which libraries allocate what they keep.
EAGER_CALLS = 3
# A graph keeps the memory of all its operations. Operations on large inputs are long, so they need none.
MAX_ROWS, MAX_GRAPHS = 4096, 16


class Captured:
    """A function of tensors on a GPU, replayed as one CUDA graph for each shape of its inputs.

    `captured(*inputs)` returns new tensors, as the function does. The function must do the same operations
    for all inputs of a shape, read no value on the host, and draw no random numbers. It may change memory
    that stays where it is, such as weights.

    Args:
        function: takes tensors [N, ...] and returns tensors.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._calls: Counter[tuple[torch.Size, ...]] = Counter()
        self._graphs: dict[tuple[torch.Size, ...], _Graph] = {}
        self._stream: torch.cuda.Stream | None = None

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
        self._stream = self._stream or torch.cuda.Stream()
        self._calls[shapes] += 1
        if self._calls[shapes] > EAGER_CALLS:
            self._graphs[shapes] = graph = _Graph(self._function, inputs, self._stream)
            return graph(*inputs)
        # On the stream of the capture, because autograd remembers the stream of a weight's first gradient.
        self._stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(self._stream):
            found = self._function(*inputs)
        torch.cuda.current_stream().wait_stream(self._stream)
        return found


class _Graph:
    """One capture of a function, and the memory of its inputs and results."""

    def __init__(
        self, function: Callable[..., Any], inputs: tuple[Tensor, ...], stream: torch.cuda.Stream
    ) -> None:
        self._inputs = [one.clone() for one in inputs]
        self._graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self._graph, stream=stream):
            found = function(*self._inputs)
        self._results, self._structure = pytree.tree_flatten(found)

    def __call__(self, *inputs: Tensor) -> Any:
        """Copy the inputs in, replay, and copy the results out: the next replay overwrites them."""
        for own, given in zip(self._inputs, inputs, strict=True):
            own.copy_(given)
        self._graph.replay()
        return pytree.tree_unflatten([result.clone() for result in self._results], self._structure)
