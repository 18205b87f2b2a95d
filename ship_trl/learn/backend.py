"""Choose what computes the conv layers: incrementally on a CPU, densely elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from ship_trl.config.network import Geometry, supports_incremental
from ship_trl.config.types import BackendName, Precision, Updates, bfloat16_allowed
from ship_trl.learn.network import Backend, Dense, DuelingNetwork


class Draw(Protocol):
    """Maps states [..., S] to the network's input: uint8 [..., C, 84, 84], or float32 [..., F]."""

    def __call__(self, state: Tensor) -> Tensor:
        """Return the input for each state."""
        ...


class PixelDraw(Draw, Protocol):
    """Draws frames, most of which resemble `background` [C, 84, 84]."""

    background: Tensor


@dataclass(frozen=True)
class Accelerator:
    """What makes learning faster than torch alone; None where nothing does. `ship_trl.fast` has all three.

    Attributes:
        incremental: makes a backend for the CPU that computes only where pictures differ from a background.
        features: makes what maps states [N, S] to what the frozen layers compute, [N, K].
        capture: makes a function of tensors on a GPU that does the same with less overhead.
    """

    incremental: Callable[[Draw, torch.dtype, Geometry], Backend] | None = None
    features: Callable[[DuelingNetwork, Draw, torch.dtype], Callable[[Tensor], Tensor]] | None = None
    capture: Callable[[Callable[..., Any]], Callable[..., Any]] | None = None


def make_backend(network: DuelingNetwork, draw: Draw, learn: Updates, accelerator: Accelerator) -> Backend:
    """Make the backend that the settings ask for."""
    device = network.advantage.weight.device
    dtype = choose_dtype(learn.precision, device)
    return choose_backend(learn.backend, draw, dtype, device, network.geometry, accelerator)


def choose_backend(
    wanted: BackendName,
    draw: Draw,
    dtype: torch.dtype,
    device: torch.device,
    geometry: Geometry,
    accelerator: Accelerator,
) -> Backend:
    """Make the backend of the conv layers; `auto` means the fastest one that supports them."""
    can_be_incremental = device.type == "cpu" and supports_incremental(geometry)
    is_dense = wanted is BackendName.dense or (wanted is BackendName.auto and not can_be_incremental)
    if is_dense or accelerator.incremental is None:
        return Dense(dtype)
    return accelerator.incremental(draw, dtype, geometry)


def choose_dtype(precision: Precision, device: torch.device) -> torch.dtype:
    """Choose the precision of the conv layers, or of the fully connected ones where there are no others.

    `auto` is bfloat16 where the device multiplies it natively, unless `SHIP_TRL_BFLOAT16=off` is set.

    Raises:
        ConfigError: this environment variable is neither `on` nor `off`.
    """
    if not bfloat16_allowed():
        native = False
    elif device.type == "cuda":
        native = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        capabilities = torch.cpu.get_capabilities()
        native = any(capabilities.get(name) for name in ("avx512_bf16", "amx_bf16"))
    if precision is Precision.bf16 or (precision is Precision.auto and native):
        return torch.bfloat16
    return torch.float32
