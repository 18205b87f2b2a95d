"""The rows of what is measured, and the networks that they are of."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ship_trl.explain.bootstrap import Estimate
from ship_trl.learn.network import DuelingNetwork


class Role(StrEnum):
    """What a network is on the page."""

    explained = "explained"
    before = "before training"
    source = "source"
    beside = "beside"
    untrained = "untrained"


@dataclass(frozen=True)
class Shown:
    """A network that is measured: by its name, in its role; `kin` is alike of those trained alike."""

    name: str
    role: Role
    network: DuelingNetwork
    kin: tuple[str, ...] | None = None


@dataclass(frozen=True)
class ProbeRow:
    """How well a quantity is read from a layer of a network; a difference is None without its control."""

    network: str
    role: str
    layer: str
    quantity: str
    r2: Estimate
    checked_r2: float
    shuffled_r2: float
    penalty: float
    over_pixels: Estimate | None
    over_untrained: Estimate | None


@dataclass(frozen=True)
class CKARow:
    """How alike a layer of two networks is; `alike` says that they were trained alike but for the seed."""

    first: str
    first_role: str
    second: str
    second_role: str
    layer: str
    alike: bool
    cka: Estimate


@dataclass(frozen=True)
class LayerRow:
    """A layer in numbers.

    `silent` counts filters that fire nowhere on any state, `active` is the share of places and states where
    they do, `changed` the norm of what training changed of the weights over that of the weights before.
    `neighbours` is the correlation of neighbouring weights, of conv1, with its interval over filters.
    """

    network: str
    role: str
    layer: str
    filters: int
    silent: int
    active: float
    changed: float | None
    neighbours: Estimate | None


@dataclass(frozen=True)
class ErasedRow:
    """How often the chosen action is another one with a thing erased, over states in which it is seen.

    `moved` is how far the advantages of all actions move, over how far they vary between states, and
    `gradient` the mean gradient on its pixels over that of all pixels.
    """

    network: str
    role: str
    thing: str
    states: int
    changed: Estimate
    over_untrained: Estimate | None
    moved: float
    gradient: float


@dataclass(frozen=True)
class Measured:
    """All rows, and what the figures need besides."""

    shown: tuple[Shown, ...]
    layers: tuple[str, ...]
    probes: list[ProbeRow]
    alike: list[CKARow]
    by_layer: list[LayerRow]
    erased: list[ErasedRow]

    @property
    def explained(self) -> Shown:
        """The first network of the command line."""
        return self.shown[0]

    def role(self, role: Role) -> list[Shown]:
        """Networks of a role."""
        return [one for one in self.shown if one.role is role]
