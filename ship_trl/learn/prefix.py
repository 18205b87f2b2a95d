"""Join and split the parts of a checkpoint by dotted names."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor


def add_prefix(name: str, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Prefix each key with a name and a dot."""
    return {f"{name}.{key}": value for key, value in state.items()}


def copy_exactly(target: Tensor, value: Tensor) -> None:
    """Copy a value into a tensor; raise RuntimeError for another shape, which `copy_` may repeat."""
    if target.shape != value.shape:
        raise RuntimeError(f"a value has the shape {tuple(value.shape)}; allowed: {tuple(target.shape)}")
    target.copy_(value)


def strip_prefix(name: str, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the entries whose key has a name and a dot as prefix, and strip the prefix."""
    return {key.removeprefix(f"{name}."): v for key, v in state.items() if key.startswith(f"{name}.")}
