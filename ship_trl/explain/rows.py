"""Measurements as rows of tables, whose fields are columns of the CSVs, and the measured networks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

from ship_trl.explain.bootstrap import Estimate
from ship_trl.learn.network import DuelingNetwork


class Role(StrEnum):
    """Why a network is measured; `before` is the explained one as its training began."""

    explained = "explained"
    before = "before training"
    source = "source"
    beside = "beside"
    untrained = "untrained"


@dataclass(frozen=True)
class Compared:
    """A network to measure. Networks of the same `settings` differ in their seed only; None if unknown."""

    name: str
    role: Role
    network: DuelingNetwork
    settings: tuple[str, ...] | None = None


@dataclass(frozen=True)
class ProbeRow:
    """Accuracy of the probe of a quantity on one layer; a difference is None where it has no control.

    `checked_r2` is R² on the validation episodes, which choose the penalty; `r2` is on held-out episodes.
    """

    network: str
    role: str
    layer: str
    quantity: str
    r2: Estimate
    checked_r2: float
    shuffled_r2: float
    over_pixels: Estimate | None
    over_untrained: Estimate | None


@dataclass(frozen=True)
class CKARow:
    """CKA of a layer of two networks; `alike` marks two that differ in their seed only."""

    first: str
    first_role: str
    second: str
    second_role: str
    layer: str
    alike: bool
    cka: Estimate


@dataclass(frozen=True)
class FilterRow:
    """Correlation of neighbouring weights of conv1, with an interval over filters."""

    network: str
    role: str
    neighbours: Estimate


@dataclass(frozen=True)
class ErasedRow:
    """Share of the states that show a thing in which the greedy action changes without it."""

    network: str
    role: str
    thing: str
    states: int
    changed: Estimate
    over_untrained: Estimate | None


@dataclass(frozen=True)
class Measured:
    """All measurements; the first network is the explained one."""

    networks: tuple[Compared, ...]
    layers: tuple[str, ...]
    probes: list[ProbeRow]
    cka: list[CKARow]
    filters: list[FilterRow]
    erased: list[ErasedRow]

    @property
    def explained(self) -> Compared:
        """The first network of the command line."""
        return self.networks[0]

    @property
    def explained_probes(self) -> list[ProbeRow]:
        """Probes of the explained network."""
        return [row for row in self.probes if row.network == self.explained.name]

    def with_role(self, role: Role) -> list[Compared]:
        """Select networks by role."""
        return [one for one in self.networks if one.role is role]

    def cka_between(self, first: Role, second: Role, layer: str) -> list[CKARow]:
        """Select CKA of a layer between networks of two roles."""
        roles = {first.value, second.value}
        return [row for row in self.cka if row.layer == layer and {row.first_role, row.second_role} == roles]

    def cka_between_seeds(self, layer: str) -> list[CKARow]:
        """Select CKA of a layer between networks that differ in their seed only."""
        return [row for row in self.cka if row.layer == layer and row.alike]

    def best_probes(self) -> Iterator[ProbeRow]:
        """Select the best layer of each quantity, by R² on the validation episodes.

        On the held-out episodes the best of several layers would look better than it is.
        """
        for quantity in dict.fromkeys(row.quantity for row in self.explained_probes):
            rows = [row for row in self.explained_probes if row.quantity == quantity]
            yield max(rows, key=lambda row: row.checked_r2)
