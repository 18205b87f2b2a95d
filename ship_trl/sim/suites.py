"""Load suites, what episodes begin with: cases, exact or perturbed, or random encounters. No torch.

A table of fixed scenes, with the planner's best plan of each, stands beside the suite that names it
(`scenes:`), as conf/suite/traffic_test.csv. There own ship begins at the origin, heading north, with its goal
600 m ahead.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.bounds import Metres
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir, is_name, list_names, stem
from ship_trl.config.schema import read_as
from ship_trl.config.types import Perturbation, Traffic, World, plain
from ship_trl.files.table import Cells, read_table
from ship_trl.sim.cases import (
    Case,
    TargetShip,
    case_names,
    check_case,
    find_case,
    load_case,
    read_values,
)

UNPERTURBED = Perturbation()
# Increase it with every change after which a seed of random encounters is another scene.
SCENES_VERSION = 2
MAX_TABLE_BYTES, MAX_SHIPS = 10_000_000, 3
SHIP_COLUMNS = ("x", "y", "heading", "speed")
TABLE_COLUMNS = (
    "name",
    "encounter",
    *(f"{column}{place}" for place in range(1, MAX_SHIPS + 1) for column in SHIP_COLUMNS),
    "best_return",
    "actions",
)


@dataclass
class SuiteFile:
    """What a suite's YAML file holds: names or paths of cases, or a distribution of scenes.

    A `unit` (metres) replaces that of the cases. `scenes` names a table of cases beside the file.
    `profile` is that of its runs, unless `profile=` is given. What the file leaves out is taken from the
    suite that it is `based_on`.
    """

    cases: list[str] = field(default_factory=list)
    scenes: str = ""
    perturbation: Perturbation = field(default_factory=Perturbation)
    unit: Metres | None = None
    traffic: Traffic | None = None
    profile: str = ""
    based_on: str = ""


@dataclass(frozen=True)
class Suite:
    """What episodes begin with: one of the cases at random, perturbed, or a random encounter.

    With `traffic` there are no cases: every episode begins with a scene of its own.
    """

    name: str
    cases: tuple[Case, ...]
    perturbation: Perturbation = UNPERTURBED
    traffic: Traffic | None = None

    @property
    def is_drawn(self) -> bool:
        """Whether two episodes of a case may begin differently."""
        return self.traffic is not None or not self.perturbation.is_none

    @cached_property
    def is_fixed(self) -> bool:
        """Whether all episodes begin alike."""
        return len(self.cases) == 1 and not self.is_drawn

    @cached_property
    def fingerprint(self) -> str:
        """Return a digest of what is drawn, twelve hex digits; of a fixed suite, its case's."""
        cases = [case.fingerprint for case in self.cases]
        if self.is_fixed:
            return cases[0]
        bounds = {name: float(bound) for name, bound in asdict(self.perturbation).items()}
        drawn = [] if self.traffic is None else [plain(self.traffic), SCENES_VERSION]
        values = json.dumps([cases, bounds, *drawn], sort_keys=True)
        return hashlib.sha256(values.encode()).hexdigest()[:12]

    @property
    def case(self) -> Case:
        """The case of a suite of one, perturbed or not.

        Raises:
            ConfigError: the suite has several cases or none.
        """
        if len(self.cases) != 1:
            has = "several cases" if self.cases else "no cases"
            raise ConfigError(f"suite {self.name}: has {has}; allowed here: one case")
        return self.cases[0]

    @property
    def unperturbed(self) -> Suite:
        """The suite of the same cases without perturbation."""
        return replace(self, perturbation=UNPERTURBED)

    @property
    def places(self) -> int:
        """The most target ships of a scene."""
        if self.traffic is not None:
            return len(self.traffic.ships) - 1
        return max(len(case.target_ships) for case in self.cases)

    def whole_rounds(self, episodes: int) -> int:
        """Return the least number of episodes, at least `episodes`, that has each case equally often."""
        count = max(1, len(self.cases))
        return count * math.ceil(episodes / count)

    def split(self) -> list[Suite]:
        """Return a suite of one for each case, perturbed alike."""
        return [suite_of(case, self.perturbation) for case in self.cases]


def suite_of(case: Case, perturbation: Perturbation = UNPERTURBED) -> Suite:
    """Return the suite of one case."""
    return Suite(case.name, (case,), perturbation)


def suite_files() -> dict[str, Path]:
    """Return the file of each suite by name: the working directory's conf/suite, then the bundled ones."""
    folders = conf_dir() / "suite", Path("conf/suite")
    return {stem(path): path for folder in folders for path in sorted(folder.glob("*.yaml"))}


def is_suite(name: str) -> bool:
    """Return whether a name is that of a suite and not of a case."""
    return name in suite_files() and find_case(name) is None


def profile_of(name: str) -> str:
    """Return the profile that a suite asks for, empty if none or if `name` is no suite."""
    if not is_suite(name):
        return ""
    return read_suite(suite_files()[name]).profile


def read_suite(path: Path) -> SuiteFile:
    """Read a suite's file.

    Raises:
        ConfigError: it is not readable as YAML, or has a wrong key or value.
    """
    values = read_values(path)
    if isinstance(values, DictConfig) and "based_on" in values:
        base = find_base(path, str(values.based_on))
        base_values = read_values(base) if base is not None else None
        if base is None or not isinstance(base_values, DictConfig) or "based_on" in base_values:
            allowed = f"one of {', '.join(sorted(suite_files()))} that is based on no other"
            raise ConfigError(f"{path}: based_on: got {values.based_on}; allowed: {allowed}")
        if base_values.get("scenes"):
            base_values.scenes = str(base.parent.absolute() / str(base_values.scenes))
        try:
            values = OmegaConf.merge(base_values, values)
        except OmegaConfBaseException:
            raise ConfigError(f"{path}: based_on: {base} has other kinds of values") from None
    return read_as(SuiteFile, values, f"{path}: ")


def find_base(path: Path, name: str) -> Path | None:
    """Return the file of the suite that another one's file names: one beside it, else a bundled one."""
    files = [folder / f"{name}.yaml" for folder in (path.parent, conf_dir() / "suite")]
    return next((file for file in files if is_name(name) and file.is_file() and file != path), None)


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
        path = suite_files()[name]
        values = read_suite(path)
        cases = tuple(load_case(case, world, f"{path}: cases", values.unit) for case in values.cases)
        if values.scenes:
            table = path.parent / values.scenes
            cases += (scenes := tuple(scene.case for scene in read_scenes(table)))
            for case in scenes:
                check_case(case, world, f"{table}: row {case.name}")
        if bool(cases) == (values.traffic is not None):
            raise ConfigError(f"{path}: allowed: either cases or scenes, or traffic")
        own = asdict(values.perturbation)
        given = {bound: value for bound, value in asdict(perturbation).items() if value > 0}
        bounds = Perturbation(**own | given)
        if values.traffic is not None and not bounds.is_none:
            raise ConfigError(f"perturbation: suite {name} draws its scenes; allowed: a suite of cases")
        return Suite(name, cases, bounds, values.traffic)
    if find_case(name) is None:
        cases_and_suites = f"{list_names(case_names())}, suite {', '.join(sorted(suite_files()))}"
        raise ConfigError(
            f"{key}: no case or suite {name}; allowed: {cases_and_suites}, or a path to a YAML file"
        )
    return suite_of(load_case(name, world, key), perturbation)


class Scene(NamedTuple):
    """A case, and its best known plan: undiscounted raw return and action indices."""

    case: Case
    best_return: float
    actions: list[int]


@cache
def read_scenes(path: Path) -> tuple[Scene, ...]:
    """Read a table of scenes.

    Raises:
        ConfigError: the file is missing, or is no such table.
    """
    return tuple(read_table(path, TABLE_COLUMNS, _to_scene, MAX_TABLE_BYTES, "suite", "a table of scenes"))


def _to_scene(cells: Cells) -> Scene:
    where = f"row {cells['name']}: "
    ships = [
        read_as(
            TargetShip,
            {column: cells[f"{column}{place}"] for column in SHIP_COLUMNS},
            f"{where}ship {place}: ",
        )
        for place in range(1, MAX_SHIPS + 1)
        if any(cells[f"{column}{place}"] for column in SHIP_COLUMNS)
    ]
    case = Case([0.0, 0.0], 90.0, [0.0, 600.0], cells["encounter"], ships, cells["name"])
    best_return = read_as(float, cells["best_return"], where, key="best_return")
    return Scene(case, best_return, [int(digit) for digit in cells["actions"]])
