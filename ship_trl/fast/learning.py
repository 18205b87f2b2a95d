"""Learning that computes conv layers incrementally on a CPU, and gradient steps as CUDA graphs on a GPU."""

from __future__ import annotations

from typing import cast

import torch

from ship_trl.config.network import Geometry
from ship_trl.fast.features import FrozenFeatures
from ship_trl.fast.graphs import Captured
from ship_trl.learn.backend import Accelerator, Backend, Draw, PixelDraw


def make_incremental(draw: Draw, dtype: torch.dtype, geometry: Geometry) -> Backend:
    """Make the backend that computes only what differs from the background."""
    # Imported here: where all layers are dense, nothing needs numba.
    from ship_trl.fast.incremental import Incremental

    return Incremental(cast(PixelDraw, draw).background, dtype, geometry)


FAST = Accelerator(make_incremental, FrozenFeatures, Captured)


def accelerator(fast: bool = True) -> Accelerator:
    """Return what makes learning faster; if not `fast`, nothing does."""
    return FAST if fast else Accelerator()
