"""Load suites: lists of cases with which episodes begin, exactly or perturbed. No torch."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Annotated

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import Rule, read_as
from ship_trl.config.types import Perturbation, World
from ship_trl.files.untrusted import read_yaml
from ship_trl.sim.cases import Case, case_names, find_case, load_case

UNPERTURBED = Perturbation()


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
    perturbation: Perturbation = UNPERTURBED

    @property
    def is_perturbed(self) -> bool:
        """Whether two episodes of a case may begin differently."""
        return not self.perturbation.is_none

    @cached_property
    def is_fixed(self) -> bool:
        """Whether all episodes begin alike."""
        return len(self.cases) == 1 and not self.is_perturbed

    @cached_property
    def fingerprint(self) -> str:
        """Return a digest of cases and perturbation, twelve hex digits; of a fixed suite, its case's."""
        cases = [case.fingerprint for case in self.cases]
        if self.is_fixed:
            return cases[0]
        bounds = {name: float(bound) for name, bound in asdict(self.perturbation).items()}
        values = json.dumps([cases, bounds], sort_keys=True)
        return hashlib.sha256(values.encode()).hexdigest()[:12]

    @property
    def case(self) -> Case:
        """The case of a suite of one, perturbed or not.

        Raises:
            ConfigError: the suite has several cases.
        """
        if len(self.cases) > 1:
            raise ConfigError(f"suite {self.name}: has several cases; allowed here: one case")
        return self.cases[0]

    @property
    def places(self) -> int:
        """The most target ships of a case."""
        return max(len(case.target_ships) for case in self.cases)

    def whole_rounds(self, episodes: int) -> int:
        """Return the least number of episodes, at least `episodes`, that has each case equally often."""
        return len(self.cases) * math.ceil(episodes / len(self.cases))

    def split(self) -> list[Suite]:
        """Return a suite of one for each case, perturbed alike."""
        return [suite_of(case, self.perturbation) for case in self.cases]


def suite_of(case: Case, perturbation: Perturbation = UNPERTURBED) -> Suite:
    """Return the suite of one case."""
    return Suite(case.name, (case,), perturbation)


def suite_names() -> list[str]:
    """List the names of all bundled suites, sorted."""
    return sorted(path.stem for path in (conf_dir() / "suite").glob("*.yaml"))


def is_suite(name: str) -> bool:
    """Return whether a name is that of a suite and not of a case."""
    return name in suite_names() and find_case(name) is None


def describe(name: str) -> str:
    """Return the name of a case or suite with its kind, such as `case 4`."""
    return f"{'suite' if is_suite(name) else 'case'} {name}"


def load_suite(
    name: str, world: World, key: str = "suite", perturbation: Perturbation = UNPERTURBED
) -> Suite:
    """Read a suite by its name in conf/suite, or a case as a suite of one.

    Bounds of `perturbation` above zero replace those of the suite.

    Raises:
        ConfigError: no such suite or case, or one of its cases is invalid.
    """
    if is_suite(name):
        path = conf_dir() / "suite" / f"{name}.yaml"
        values = read_as(SuiteFile, read_yaml(path), f"{path}: ")
        cases = tuple(load_case(case, world, f"{path}: cases") for case in values.cases)
        own = asdict(values.perturbation)
        given = {bound: value for bound, value in asdict(perturbation).items() if value > 0}
        return Suite(name, cases, Perturbation(**own | given))
    if find_case(name) is None:
        cases_and_suites = f"{', '.join(case_names())}, suite {', '.join(suite_names())}"
        raise ConfigError(
            f"{key}: no case or suite {name}; allowed: {cases_and_suites}, or a path to a YAML file"
        )
    return suite_of(load_case(name, world, key), perturbation)
