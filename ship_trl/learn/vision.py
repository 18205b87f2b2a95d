"""How networks see states: on a CPU by what differs from a still picture, elsewhere as a whole."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import torch
from torch import Tensor

from ship_trl.config import Precision, bfloat16_allowed
from ship_trl.learn.delta import Cutter, Rows
from ship_trl.learn.filters import Filters
from ship_trl.learn.glance import Glance
from ship_trl.learn.network import CONV_NAMES, DuelingNetwork


class Draw(Protocol):
    """Draws states: float [..., S] to uint8 [..., C, 84, 84]; most frames resemble `still` [C, 84, 84]."""

    still: Tensor

    def __call__(self, state: Tensor) -> Tensor:
        """The pictures of states."""
        ...


class Reader(Protocol):
    """A network in the precision that computes: reads what a `Vision` has looked at.

    `parameters` are what an optimiser may change: they share the network's memory.
    """

    parameters: list[Tensor]

    def q_values(self, seen: Any) -> Tensor:
        """Q-values, float32 [B, A]."""
        ...

    def advance(self, seen: Any, layers: int) -> Any:
        """Through the first `layers` conv layers, which are frozen."""
        ...

    def learn(self) -> None:
        """Record what gradients need, from the next Q-values on."""
        ...

    def refresh(self) -> None:
        """The network's weights have changed."""
        ...

    def hand_back(self) -> None:
        """Gradients have been taken: give them to the network."""
        ...


class Actor(Protocol):
    """A network that decides, of a few frames at a time."""

    def actions(self, frames: Tensor) -> Tensor:
        """The best actions: uint8 [B, C, 84, 84] to int64 [B]."""
        ...

    def changed(self) -> None:
        """The network's weights have changed."""
        ...


class DeltaVision:
    """On a CPU: frames as windows that differ from the still picture (see `delta`)."""

    def __init__(self, draw: Draw, dtype: torch.dtype) -> None:
        self.draw, self.dtype = draw, dtype
        self.cut = Cutter(draw.still, dtype)

    def look(self, state: Tensor) -> Rows:
        """Draw states [B, S] and cut them into windows."""
        return self.cut(self.draw(state))

    def reader(self, network: DuelingNetwork, frozen: int) -> Reader:
        """The network as a reader of windows."""
        return Filters(network, self.dtype, frozen)

    def actor(self, network: DuelingNetwork, frozen: int) -> Glance:
        """The network as one that decides."""
        return Glance(network, self.draw.still, frozen)


class DenseVision:
    """On any device: frames as they are."""

    def __init__(self, draw: Callable[[Tensor], Tensor], dtype: torch.dtype) -> None:
        self.draw, self.dtype = draw, dtype

    def look(self, state: Tensor) -> Tensor:
        """Draw states [B, S]."""
        return self.draw(state)

    def reader(self, network: DuelingNetwork, frozen: int) -> Reader:
        """The network as a reader of frames."""
        return DenseReader(network, self.dtype, frozen)

    def actor(self, network: DuelingNetwork, frozen: int) -> Actor:
        """The network as one that decides."""
        return DenseReader(network, self.dtype, frozen)


class DenseReader:
    """The network itself; its conv layers under autocast where the precision is bfloat16."""

    def __init__(self, network: DuelingNetwork, dtype: torch.dtype, frozen: int) -> None:
        self.network, self.dtype = network, dtype
        still = CONV_NAMES[:frozen]
        named = network.named_parameters()
        self.parameters: list[Tensor] = [p for name, p in named if not name.startswith(still)]

    def q_values(self, seen: Tensor) -> Tensor:
        """Q-values of frames."""
        with torch.autocast(seen.device.type, torch.bfloat16, enabled=self.dtype is torch.bfloat16):
            features = self.network.features(seen)
        # Where values are large, actions differ by less than bfloat16 can tell.
        return self.network.dueling(features.float())

    def advance(self, seen: Tensor, layers: int) -> Tensor:
        """Frames stay frames: the whole network reads them."""
        return seen

    def learn(self) -> None:
        """The network's own weights say what they need."""

    @torch.no_grad()
    def actions(self, frames: Tensor) -> Tensor:
        """The best actions."""
        return self.q_values(frames).argmax(-1)

    def changed(self) -> None:
        """Nothing is remembered."""

    def refresh(self) -> None:
        """Nothing is copied."""

    def hand_back(self) -> None:
        """Gradients are where they belong."""


def computing(precision: Precision, device: torch.device) -> torch.dtype:
    """The precision of the conv layers: `auto` is bfloat16 where the device multiplies it natively.

    `SHIP_TRL_BFLOAT16=off` says that no device does.

    Raises:
        ConfigError: that variable has another value than `on` and `off`.
    """
    if not bfloat16_allowed():
        native = False
    elif device.type == "cuda":
        native = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        able = torch.cpu.get_capabilities()
        native = any(able.get(name) for name in ("avx512_bf16", "amx_bf16"))
    if precision is Precision.bf16 or (precision is Precision.auto and native):
        return torch.bfloat16
    return torch.float32
