"""Choose what computes the conv layers: incrementally on a CPU, densely elsewhere."""

from __future__ import annotations

from typing import Protocol, cast

import torch
from torch import Tensor

from ship_trl.config.network import Geometry, supports_incremental
from ship_trl.config.types import BackendName, Precision, Updates, bfloat16_allowed
from ship_trl.learn.dense import Backend, Dense
from ship_trl.learn.network import DuelingNetwork


class Draw(Protocol):
    """Maps states [..., S] to the network's input: uint8 [..., C, 84, 84], or float32 [..., F]."""

    def __call__(self, state: Tensor) -> Tensor:
        """Return the input for each state."""
        ...


class PixelDraw(Draw, Protocol):
    """Draws frames, most of which resemble `background` [C, 84, 84]."""

    background: Tensor


def make_backend(network: DuelingNetwork, draw: Draw, learn: Updates) -> Backend:
    """Make the backend that the settings ask for."""
    device = network.advantage.weight.device
    dtype = choose_dtype(learn.precision, device)
    return choose_backend(learn.backend, draw, dtype, device, network.geometry)


def choose_backend(
    wanted: BackendName, draw: Draw, dtype: torch.dtype, device: torch.device, geometry: Geometry
) -> Backend:
    """Make the backend of the conv layers; `auto` means the fastest one that supports them."""
    can_be_incremental = device.type == "cpu" and supports_incremental(geometry)
    fastest = BackendName.incremental if can_be_incremental else BackendName.dense
    chosen = fastest if wanted is BackendName.auto else wanted
    if chosen is BackendName.dense:
        return Dense(dtype)
    # Imported here: where all layers are dense, nothing needs numba.
    from ship_trl.learn.fast.incremental import Incremental

    return Incremental(cast(PixelDraw, draw).background, dtype, geometry)


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
