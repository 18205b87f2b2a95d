"""Load suites: lists of cases with which episodes begin, exactly or perturbed. No torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated

from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import Rule, limit, read_as
from ship_trl.config.types import MAX_DISTANCE, World
from ship_trl.files.untrusted import read_yaml
from ship_trl.sim.cases import Case, find_case, load_case

Bound = Annotated[float, limit(0, MAX_DISTANCE)]


@dataclass(frozen=True)
class Perturbation:
    """Bounds of uniform random changes of a case's start, to either side.

    `own_position` (m) moves own ship along x and y, `own_heading` (degrees) turns it; `ship_position` (m) and
    `ship_speed` (m/s) change each target ship, whose speed stays at least zero.
    """

    own_position: Bound = 0.0
    own_heading: Annotated[float, limit(0, 180)] = 0.0
    ship_position: Bound = 0.0
    ship_speed: Bound = 0.0

    @property
    def is_none(self) -> bool:
        """Whether nothing is changed."""
        return self == Perturbation()


@dataclass
class SuiteFile:
    """What a suite's YAML file holds: names or paths of cases."""

    cases: Annotated[list[str], Rule("at least one case", bool)]
    perturbation: Perturbation = field(default_factory=Perturbation)


@dataclass(frozen=True)
class Suite:
    """What episodes begin with: one of the cases at random, perturbed."""

    name: str
    cases: tuple[Case, ...]
    perturbation: Perturbation = Perturbation()

    @cached_property
    def is_fixed(self) -> bool:
        """Whether all episodes begin alike."""
        return len(self.cases) == 1 and self.perturbation.is_none

    @property
    def places(self) -> int:
        """The most target ships of a case."""
        return max(len(case.target_ships) for case in self.cases)


def suite_of(case: Case, perturbation: Perturbation = Perturbation()) -> Suite:
    """Return the suite of one case."""
    return Suite(case.name, (case,), perturbation)


def suite_names() -> list[str]:
    """List the names of all bundled suites, sorted."""
    return sorted(path.stem for path in (conf_dir() / "suite").glob("*.yaml"))


def load_suite(name: str, world: World, key: str = "suite") -> Suite:
    """Read a suite by its name in conf/suite, or a case as a suite of one.

    Raises:
        ConfigError: no such suite or case, or one of its cases is invalid.
    """
    path = conf_dir() / "suite" / f"{Path(name).name}.yaml"
    if find_case(name) is not None or path.stem != name or not path.is_file():
        return suite_of(load_case(name, world, key))
    values = read_as(SuiteFile, read_yaml(path), f"{path}: ")
    cases = tuple(load_case(case, world, f"{path}: cases") for case in values.cases)
    return Suite(name, cases, values.perturbation)
