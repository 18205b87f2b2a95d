"""Load cases, one YAML file each, and check them. No torch."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from omegaconf import DictConfig, ListConfig, OmegaConf
from pydantic import Field
from yaml import YAMLError

from ship_trl.config.bounds import MAX_DISTANCE, Metres
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.paths import conf_dir, is_name, list_names, stem
from ship_trl.config.schema import read_as, rule
from ship_trl.config.types import World
from ship_trl.files.disk import read_file
from ship_trl.files.untrusted import read_changes, read_yaml

MAX_TARGET_SHIPS = 8
# Within this bound float32 is accurate to a centimetre, or to a hundredth of a degree.
Number = Annotated[float, Field(ge=-MAX_DISTANCE, le=MAX_DISTANCE)]
SHIP_COUNT = rule(f"at most {MAX_TARGET_SHIPS} ships", lambda ships: len(ships) <= MAX_TARGET_SHIPS)
Point = Annotated[list[Number], rule("two numbers, as [X,Y]", lambda point: len(point) == 2)]
IdealPath = Annotated[str, rule("one line of plain text", str.isprintable)]


# A target ship holds course and speed, or gives way to own ship by the rules (`world.give_way`).
Behaviour = StrEnum("Behaviour", ["holds", "gives_way"])
# Their numbers in a state. A ship that is giving way goes on until the ships have passed (Rule 13(d)).
HOLDS_COURSE, GIVES_WAY, GIVING_WAY = 0.0, 1.0, 2.0
BEHAVIOURS = {Behaviour.holds: HOLDS_COURSE, Behaviour.gives_way: GIVES_WAY}


@dataclass
class TargetShip:
    """A target ship: metres, degrees counter-clockwise from east, m/s."""

    x: Number
    y: Number
    heading: Number
    speed: Annotated[float, Field(ge=0, le=MAX_DISTANCE)]
    behaviour: Behaviour = Behaviour.holds


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
class ShipFile(Direction):
    """A target ship in a case's YAML file."""

    x: Number
    y: Number
    speed: Annotated[float, Field(ge=0, le=MAX_DISTANCE)]
    behaviour: Behaviour = Behaviour.holds


@dataclass
class CaseFile(Direction):
    """Fields of a case's YAML file; `unit` is how many metres a 1 in a coordinate stands for."""

    start: Point
    goal: Point
    ideal_path: IdealPath
    target_ships: Annotated[list[ShipFile], SHIP_COUNT]
    unit: Metres = 1.0

    def to_case(self, name: str, unit: float, where: str) -> Case:
        """Return the case of this name with its coordinates in metres; `where` begins messages."""
        ships = [
            TargetShip(
                *(unit * ship.x, unit * ship.y, ship.to_heading(f"{where}target_ships[{n}].")),
                *(ship.speed, ship.behaviour),
            )
            for n, ship in enumerate(self.target_ships)
        ]
        start, goal = ([unit * number for number in point] for point in (self.start, self.goal))
        return Case(start, self.to_heading(where), goal, self.ideal_path, ships, name)


@dataclass
class Case:
    """One encounter (figure 4): metres, degrees counter-clockwise from east. `name` is the stem of its file.

    `ideal_path` names the shortest safe path, which cases may share. Only similarity reads it.
    """

    start: list[float]
    heading: float
    goal: list[float]
    ideal_path: str
    target_ships: list[TargetShip]
    name: str = ""

    @property
    def fingerprint(self) -> str:
        """Return a digest of the case, without its name: twelve hex digits."""
        values = asdict(self)
        del values["name"]
        # Left out at the default, so that older cases keep their fingerprints.
        for ship in values["target_ships"]:
            if (behaviour := ship.pop("behaviour")) is not Behaviour.holds:
                ship["behaviour"] = behaviour.name
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]


def to_heading(course: float) -> float:
    """Return the heading, from -90 to 270 degrees counter-clockwise from east, of a course."""
    heading = 90.0 - course
    return heading + 360.0 if heading < -90.0 else heading


def to_course(heading: float) -> float:
    """Return the course, from 0 to below 360 degrees clockwise from north, of a heading."""
    return (90.0 - heading) % 360.0


def load_world(name: str = "paper", changes: Iterable[str] = ()) -> World:
    """Read the shared physics of conf/world, for use without Hydra, with changes such as "turn_time=4"."""
    values = read_yaml(conf_dir() / "world" / f"{name}.yaml")
    return read_as(World, OmegaConf.merge(values, read_changes(changes)), key="world")


def case_folders() -> list[Path]:
    """Return the folders to search for cases: the working directory's conf/case, then the bundled ones."""
    return [Path("conf/case"), conf_dir() / "case"]


def case_names() -> list[str]:
    """Return the sorted names of all cases."""
    return sorted({stem(path) for folder in case_folders() for path in folder.glob("*.yaml")})


def shadowing_file(kind: str, name: str) -> Path | None:
    """Return the working directory's file if it hides another bundled case or suite (`kind`) of this name."""
    own, bundled = (folder / kind / f"{name}.yaml" for folder in (Path("conf"), conf_dir()))
    both = is_file(own) and is_file(bundled)
    return own if both and read_file(own) != read_file(bundled) else None


def load_case(name: str, world: World, key: str = "case", unit: float | None = None) -> Case:
    """Read a case by name, or by the path of a YAML file, and check that it fits the world.

    `unit` (metres) replaces that of the file.

    Raises:
        ConfigError: there is no such case, a field is missing, unknown or invalid, or see `check_case`.
    """
    path = find_case(name)
    if path is None:
        allowed = f"{list_names(case_names())}, or a path to a YAML file"
        raise ConfigError(f"{key}: no case {name}; allowed: {allowed}")
    if not is_name(stem(path)):
        # Results are written to a folder of this name.
        raise ConfigError(f"{key}: {path!s:.200}: its name cannot name a folder; allowed: rename the file")
    found = read_as(CaseFile, read_values(path), f"{path}: ")
    case = found.to_case(stem(path), unit or found.unit, f"{path}: ")
    check_case(case, world, str(path))
    return case


def readable_cases(world: World) -> list[Case]:
    """Return the cases of all names; an error is printed for a file that is invalid."""
    cases = []
    for name in case_names():
        try:
            cases.append(load_case(name, world))
        except ConfigError as error:
            print_error(f"left out: {error}")
    return cases


def find_case(name: str) -> Path | None:
    """Return the file of a case, by name or path, or None where there is none."""
    if name.endswith((".yaml", ".yml")):
        paths = [Path(name)]
    else:
        paths = [folder / f"{name}.yaml" for folder in case_folders()]
    return next(filter(is_file, paths), None)


def is_file(path: Path) -> bool:
    """Return whether a path is a file; False for a path that the system refuses."""
    try:
        return path.is_file()
    except OSError:
        return False


def read_values(path: Path) -> DictConfig | ListConfig:
    """Read the values of a case's or suite's YAML file.

    Raises:
        ConfigError: it is not readable as YAML.
    """
    try:
        return read_yaml(path)
    except (YAMLError, OSError) as error:
        raise ConfigError(f"{path}: not readable as YAML: {' '.join(str(error).split())}") from None


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
            f"{where}: goal: cannot be reached: {to_goal:.0f} m to go, but "
            f"{world.max_steps} steps (world.max_steps) of {world.dt:g} s at up to {fastest:g} m/s "
            f"cover only {reach:.0f} m"
        )
    for index, ship in enumerate(case.target_ships):
        distance = math.dist(case.start, (ship.x, ship.y))
        if distance < world.safe_distance:
            raise ConfigError(
                f"{where}: target_ships[{index}]: must start at least the safe distance of "
                f"{world.safe_distance:g} m from own ship, got {distance:.1f} m"
            )
