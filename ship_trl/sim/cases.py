"""Load cases and suites, what episodes begin with, one YAML file each, and check them. No torch.

A suite has cases, exact or perturbed, or draws random encounters; a case is a suite of one. A table of fixed
scenes, with the planner's best plan of each, stands beside the suite that names it (`scenes:`), as
conf/suite/traffic_test.csv. There own ship begins at the origin, heading north, with its goal 600 m ahead.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cache, cached_property
from itertools import count
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import Field
from yaml import YAMLError

from ship_trl.config.bounds import MAX_DISTANCE, Metres
from ship_trl.config.errors import ConfigError, explain, print_error
from ship_trl.config.paths import conf_dir, conf_files, is_name, list_names, stem
from ship_trl.config.schema import read_as, rule
from ship_trl.config.types import Perturbation, Traffic, World, plain
from ship_trl.files.disk import read_file
from ship_trl.files.untrusted import Cells, read_table, read_yaml
from ship_trl.sim.scale import Scale

MAX_TARGET_SHIPS = 8
# Within this bound float32 is accurate to a centimetre, or to a hundredth of a degree.
Number = Annotated[float, Field(ge=-MAX_DISTANCE, le=MAX_DISTANCE)]
FEW = rule(f"at most {MAX_TARGET_SHIPS} ships", lambda ships: len(ships) <= MAX_TARGET_SHIPS)
Point = Annotated[list[Number], rule("two numbers, as [X,Y]", lambda point: len(point) == 2)]
UNPERTURBED = Perturbation()
# Increase it with every change after which a seed of random encounters is another scene.
SCENES_VERSION = 2
# Of how ships give way by default: 2 since they begin 30 s before, at 0.1 rad/s.
GIVE_WAY_VERSION = 2
MAX_TABLE_BYTES, MAX_SHIPS = 10_000_000, 3
SHIP_COLUMNS = ("x", "y", "heading", "speed")
TABLE_COLUMNS = (
    *("name", "encounter"),
    *(f"{column}{place}" for place in range(1, MAX_SHIPS + 1) for column in SHIP_COLUMNS),
    *("best_return", "actions"),
)

# A target ship holds course and speed, or gives way to own ship by the rules (`world.give_way`).
Behaviour = StrEnum("Behaviour", ["holds", "gives_way"])
# Their numbers in a state. A ship that is giving way goes on until the ships have passed (Rule 13(d)).
HOLDS_COURSE, GIVES_WAY, GIVING_WAY = 0.0, 1.0, 2.0
# From here on the numbers of ships that follow a recorded path.
FIRST_RECORDED = 3
BEHAVIOURS = {Behaviour.holds: HOLDS_COURSE, Behaviour.gives_way: GIVES_WAY}


@dataclass
class TargetShip:
    """A target ship: metres, degrees counter-clockwise from east, m/s."""

    x: Number
    y: Number
    heading: Number
    speed: Annotated[float, Field(ge=0, le=MAX_DISTANCE)]
    behaviour: Behaviour = Behaviour.holds

    @property
    def behaviour_number(self) -> float:
        """Its behaviour in a state."""
        return BEHAVIOURS[self.behaviour]


@dataclass
class RecordedShip(TargetShip):
    """A target ship that follows its recorded path: x and y (m) after each step; then it keeps its course.

    `number` tells it from the other recorded ships of its suite.
    """

    path: tuple[tuple[float, float], ...] = ()
    number: int = 0

    @property
    def behaviour_number(self) -> float:
        """Its behaviour in a state: which path it follows (`ship_trl.sim.replay`)."""
        return FIRST_RECORDED + self.number


@dataclass(kw_only=True)
class Direction:
    """The direction of a ship in a file, degrees: `course` clockwise from north, or `heading` as above."""

    course: Annotated[float, Field(ge=0, le=360)] = math.nan
    heading: Number = math.nan

    def to_heading(self, where: str) -> float:
        """Return the heading; `where` begins the message of a `ConfigError`: neither or both are given."""
        if math.isnan(self.course) and math.isnan(self.heading):
            raise ConfigError(f"{where}course: missing; a value is needed")
        if not math.isnan(self.course) and not math.isnan(self.heading):
            raise ConfigError(
                f"{where}course and heading: must be one of them: course (degrees clockwise from north), or "
                "heading (counter-clockwise from east)"
            )
        return to_heading(self.course) if math.isnan(self.heading) else self.heading


@dataclass
class ShipFile(Direction, TargetShip):
    """A target ship in a case's YAML file."""


@dataclass
class CaseFile(Direction):
    """Fields of a case's YAML file; `unit` is how many metres a 1 in a coordinate stands for."""

    start: Point
    goal: Point
    ideal_path: Annotated[str, rule("one line of plain text", str.isprintable)]
    target_ships: Annotated[list[ShipFile], FEW]
    unit: Metres = 1.0


@dataclass
class Case:
    """One encounter (figure 4): metres, degrees counter-clockwise from east. `name` is the stem of its file.

    `ideal_path` names the shortest safe path, which cases may share. Only similarity reads it. Encounters of
    other tools have a `scale`, and recorded ones own ship's `track`, x and y (m) after each step
    (`ship_trl.formats`).
    """

    start: list[float]
    heading: float
    goal: list[float]
    ideal_path: str
    target_ships: list[TargetShip]
    name: str = ""
    scale: Scale | None = field(default=None, compare=False)
    track: tuple[tuple[float, float], ...] = field(default=(), compare=False)

    @property
    def fingerprint(self) -> str:
        """Return a digest of what happens in the case, without its name: twelve hex digits."""
        values = asdict(self)
        del values["name"], values["scale"], values["track"]
        numbers = count()
        for ship in values["target_ships"]:
            if "number" in ship:  # of its suite
                ship["number"] = next(numbers)
            # Left out at the default, so that older cases keep their fingerprints.
            if (behaviour := ship.pop("behaviour")) is not Behaviour.holds:
                ship["behaviour"] = behaviour.name
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]


@dataclass
class SuiteFile:
    """What a suite's YAML file holds: names or paths of cases, or a distribution of scenes.

    A `unit` (metres) replaces that of the cases. `scenes` names a table of cases beside the file.
    `profile` is that of its runs, unless `profile=` is given. What the file leaves out is taken from the
    suite that it is `based_on`.
    """

    cases: list[str] = field(default_factory=list)
    scenes: str = ""
    perturbation: Perturbation = UNPERTURBED
    unit: Metres | None = None
    traffic: Traffic | None = None
    profile: str = ""
    based_on: str = ""


# Keys that tell a suite's file from a case's.
ONLY_SUITES = {"cases", "scenes", "traffic", "based_on"}


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
        if self.traffic is not None and self.traffic.reacting:
            drawn.append(GIVE_WAY_VERSION)
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

    def whole_rounds(self, episodes: int) -> int:
        """Return the least number of episodes, at least `episodes`, that has each case equally often."""
        cases = max(1, len(self.cases))
        return cases * math.ceil(episodes / cases)


def behaviour_of(number: float) -> Behaviour:
    """Return the behaviour of a ship with this number in a state; one that is giving way gives way."""
    begins_as = GIVES_WAY if number == GIVING_WAY else HOLDS_COURSE if number >= FIRST_RECORDED else number
    return next(word for word, begin in BEHAVIOURS.items() if begin == begins_as)


def suite_of(case: Case, perturbation: Perturbation = UNPERTURBED) -> Suite:
    """Return the suite of one case."""
    return Suite(case.name, (case,), perturbation)


def to_heading(course: float) -> float:
    """Return the heading, from -90 to 270 degrees counter-clockwise from east, of a course."""
    heading = 90.0 - course
    return heading + 360.0 if heading < -90.0 else heading


def to_course(heading: float) -> float:
    """Return the course, from 0 to below 360 degrees clockwise from north, of a heading."""
    return (90.0 - heading) % 360.0


def load_world(changes: Mapping[str, Any] | DictConfig | None = None) -> World:
    """Read the shared physics, conf/world/paper.yaml, without Hydra, with changes as {"turn_time": 4}."""
    values = merge(read_yaml(conf_dir() / "world/paper.yaml"), changes or {}, "world")
    return read_as(World, values, key="world")


def merge(values: Any, changes: Any, key: str) -> Any:
    """Return values with changes, also of groups inside them; `key` is their key in a `ConfigError`."""
    try:
        return OmegaConf.merge(values, changes)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{key}.{explain(error)}") from None


def shadowing_file(kind: str, name: str) -> Path | None:
    """Return the working directory's file if it hides another bundled case or suite (`kind`) of this name."""
    own, bundled = conf_files(kind).get(name), conf_dir() / kind / f"{name}.yaml"
    hides = own is not None and bundled.is_file() and read_file(own) != read_file(bundled)
    return own if hides else None


def find_case(name: str) -> Path | None:
    """Return the file of a case, by name or path, or None where there is none."""
    path = Path(name) if name.endswith((".yaml", ".yml")) else conf_files("case").get(name)
    with suppress(OSError):  # of a path that the system refuses
        return path if path is not None and path.is_file() else None
    return None


def is_suite(name: str) -> bool:
    """Return whether a name is that of a suite and not of a case."""
    return name in conf_files("suite") and find_case(name) is None


def describe(name: str) -> str:
    """Return the name of a case or suite with its kind, such as `case 4`."""
    return f"{'suite' if is_suite(name) else 'case'} {name}"


def profile_of(name: str) -> str:
    """Return the profile that a suite asks for, empty if none or if `name` is no suite."""
    return read_suite(conf_files("suite")[name]).profile if is_suite(name) else ""


def read_values(path: Path) -> DictConfig | ListConfig:
    """Read the values of a case's or suite's YAML file.

    Raises:
        ConfigError: it is not readable as YAML.
    """
    try:
        return read_yaml(path)
    except (YAMLError, OSError) as error:
        raise ConfigError(f"{path}: not readable as YAML: {' '.join(str(error).split())}") from None


def load_case(name: str, world: World, key: str = "case", unit: float | None = None) -> Case:
    """Read a case by name, or by the path of a YAML file, and check that it fits the world.

    `unit` (metres) replaces that of the file.

    Raises:
        ConfigError: there is no such case, a field is missing, unknown or invalid, or see `check_case`.
    """
    path = find_case(name)
    if path is None:
        allowed = f"{list_names(conf_files('case'))}, or a path to a case's YAML file"
        raise ConfigError(f"{key}: no case {name}; allowed: {allowed}")
    if not is_name(stem(path)):
        # Results are written to a folder of this name.
        raise ConfigError(f"{key}: {path!s:.200}: its name cannot name a folder; allowed: rename the file")
    where = f"{path}: "
    values = read_values(path)
    if isinstance(values, DictConfig) and not ONLY_SUITES.isdisjoint(map(str, values)):
        allowed = "a case's file, or the name of a suite in conf/suite, here or where you work"
        raise ConfigError(f"{where}holds a suite; allowed: {allowed}")
    found = read_as(CaseFile, values, where)
    unit = unit or found.unit
    ships = []
    for n, ship in enumerate(found.target_ships):
        place, heading = (unit * ship.x, unit * ship.y), ship.to_heading(f"{where}target_ships[{n}].")
        ships.append(TargetShip(*place, heading, ship.speed, ship.behaviour))
    start, goal = ([unit * number for number in point] for point in (found.start, found.goal))
    case = Case(start, found.to_heading(where), goal, found.ideal_path, ships, stem(path))
    check_case(case, world, str(path))
    return case


def readable_cases(world: World) -> list[Case]:
    """Return the cases of all names; an error is printed for a file that is invalid."""
    cases = []
    for name in sorted(conf_files("case")):
        try:
            cases.append(load_case(name, world))
        except ConfigError as error:
            print_error(f"left out: {error}")
    return cases


def check_case(case: Case, world: World, where: str) -> None:
    """Check that a case fits the world; `where` begins the messages.

    Raises:
        ConfigError: the goal cannot be reached in time, or a ship starts inside the safe distance or too far
            away for its unit.
    """
    points = [case.start, case.goal, *([ship.x, ship.y] for ship in case.target_ships)]
    if max(abs(number) for point in points for number in point) > MAX_DISTANCE:
        raise ConfigError(f"{where}: unit: must keep all coordinates within {MAX_DISTANCE:g} m")
    to_goal = math.dist(case.start, case.goal) - world.goal_distance
    if to_goal <= 0:
        raise ConfigError(
            f"{where}: goal: must be more than {world.goal_distance:g} m (world.goal_distance) from the start"
        )
    fastest = max(abs(speed) for speed, _ in world.actions)
    reach = fastest * world.dt * world.max_steps
    if to_goal > reach and not math.isclose(to_goal, reach):
        raise ConfigError(
            f"{where}: goal: cannot be reached: {to_goal:.0f} m to go, but {world.max_steps} steps "
            f"(world.max_steps) of {world.dt:g} s at up to {fastest:g} m/s cover only {reach:.0f} m"
        )
    for index, ship in enumerate(case.target_ships):
        distance = math.dist(case.start, (ship.x, ship.y))
        if distance < world.safe_distance:
            raise ConfigError(
                f"{where}: target_ships[{index}]: must start at least the safe distance of "
                f"{world.safe_distance:g} m from own ship, got {distance:.1f} m"
            )


def read_suite(path: Path) -> SuiteFile:
    """Read a suite's file; it may be based on a suite beside it, or on a bundled one.

    Raises:
        ConfigError: it is not readable as YAML, or has a wrong key or value.
    """
    values = read_values(path)
    if isinstance(values, DictConfig) and "based_on" in values:
        name = str(values.based_on)
        files = [folder / f"{name}.yaml" for folder in (path.parent, conf_dir() / "suite")]
        base = next((file for file in files if is_name(name) and file.is_file() and file != path), None)
        base_values = read_values(base) if base is not None else None
        if base is None or not isinstance(base_values, DictConfig) or "based_on" in base_values:
            allowed = f"one of {', '.join(sorted(conf_files('suite')))} that is based on no other"
            raise ConfigError(f"{path}: based_on: got {name}; allowed: {allowed}")
        if base_values.get("scenes"):
            base_values.scenes = str(base.parent.absolute() / str(base_values.scenes))
        try:
            values = OmegaConf.merge(base_values, values)
        except OmegaConfBaseException:
            raise ConfigError(f"{path}: based_on: {base} has other kinds of values") from None
    return read_as(SuiteFile, values, f"{path}: ")


def load_suite(
    name: str, world: World, key: str = "suite", perturbation: Perturbation = UNPERTURBED
) -> Suite:
    """Read a suite by its name in conf/suite, or a case as a suite of one.

    Bounds of `perturbation` above zero replace those of the suite.

    Raises:
        ConfigError: no such suite or case, or one of its cases is invalid.
    """
    if not is_suite(name):
        if find_case(name) is None:
            known = f"{list_names(conf_files('case'))}, suite {', '.join(sorted(conf_files('suite')))}"
            paths = "or a path: of a case's YAML file, or of encounters of another tool"
            raise ConfigError(f"{key}: no case or suite {name}; allowed: {known}, {paths}")
        return suite_of(load_case(name, world, key), perturbation)
    path = conf_files("suite")[name]
    values = read_suite(path)
    cases = [load_case(case, world, f"{path}: cases", values.unit) for case in values.cases]
    if values.scenes:
        table = path.parent / values.scenes
        for scene in read_scenes(table):
            check_case(scene.case, world, f"{table}: row {scene.case.name}")
            cases.append(scene.case)
    if bool(cases) == (values.traffic is not None):
        raise ConfigError(f"{path}: allowed: either cases or scenes, or traffic")
    given = {bound: value for bound, value in asdict(perturbation).items() if value > 0}
    bounds = Perturbation(**asdict(values.perturbation) | given)
    if values.traffic is not None and not bounds.is_none:
        raise ConfigError(f"perturbation: suite {name} draws its scenes; allowed: a suite of cases")
    return Suite(name, tuple(cases), bounds, values.traffic)


class Scene(NamedTuple):
    """A case, and its best known plan: undiscounted raw return, NaN without a plan, and action indices."""

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
    where, ships = f"row {cells['name']}: ", []
    for place in range(1, MAX_SHIPS + 1):
        values = {column: cells[f"{column}{place}"] for column in SHIP_COLUMNS}
        if any(values.values()):
            ships.append(read_as(TargetShip, values, f"{where}ship {place}: "))
    case = Case([0.0, 0.0], 90.0, [0.0, 600.0], cells["encounter"], ships, cells["name"])
    # Without a plan the cell is empty.
    known = cells["best_return"]
    best_return = read_as(float, known, where, key="best_return") if known else math.nan
    return Scene(case, best_return, [int(digit) for digit in cells["actions"]])
