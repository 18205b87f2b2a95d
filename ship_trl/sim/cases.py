"""Cases: one YAML file each, read and checked without torch."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from ship_trl.config.errors import ConfigError, explain
from ship_trl.config.paths import conf_dir, is_name
from ship_trl.config.shapes import check_shapes
from ship_trl.config.types import World
from ship_trl.files.disk import read_file
from ship_trl.files.untrusted import read_yaml

MAX_TARGET_SHIPS = 8
# Metres, degrees, m/s. Up to here 32-bit numbers are right to a centimetre.
LARGEST = 1e5


@dataclass
class TargetShip:
    """A ship that holds course and speed: metres, degrees counter-clockwise from east, m/s."""

    x: float
    y: float
    heading: float
    speed: float


@dataclass
class CaseFile:
    """What a case's YAML file holds.

    `ideal_path` names the shortest safe path; equal names, equal paths. Only similarity reads it.
    """

    start: list[float]
    heading: float
    goal: list[float]
    ideal_path: str
    target_ships: list[TargetShip]


@dataclass
class Case(CaseFile):
    """One encounter (figure 4), by the name of its file."""

    name: str = ""

    @property
    def fingerprint(self) -> str:
        """Twelve hex digits over what the case is, whatever it is called."""
        values = asdict(self)
        del values["name"]
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]


def load_world(name: str = "paper") -> World:
    """Read the shared physics of conf/world, for use without Hydra."""
    values = OmegaConf.merge(
        OmegaConf.structured(World), OmegaConf.load(conf_dir() / "world" / f"{name}.yaml")
    )
    world: Any = OmegaConf.to_object(values)
    return world


def case_folders() -> list[Path]:
    """Where cases are looked up by name: the working directory's conf/case, then the shipped ones."""
    return [Path("conf/case"), conf_dir() / "case"]


def case_names() -> list[str]:
    """Names of all cases that can be found, sorted."""
    return sorted({path.stem for folder in case_folders() for path in folder.glob("*.yaml")})


def in_place_of(name: str) -> Path | None:
    """Return the working directory's case that is taken for another, shipped one of this name."""
    own, shipped = (folder / f"{name}.yaml" for folder in case_folders())
    both = is_file(own) and is_file(shipped)
    return own if both and read_file(own) != read_file(shipped) else None


def load_case(name: str, world: World, key: str = "case") -> Case:
    """Read a case by name, or by the path of a YAML file, and check it against the world.

    Raises:
        ConfigError: no such case, or a file with a missing or unknown field, a wrong type, a
            number that is not finite or too large, a goal that no policy can reach in time, a ship
            starting inside the safe distance, too many ships.
    """
    if name.endswith((".yaml", ".yml")):
        path = Path(name)
    else:
        found = [folder / f"{name}.yaml" for folder in case_folders()]
        path = next((p for p in found if is_file(p)), found[-1])
    if not is_file(path):
        raise ConfigError(
            f"{key}: no case {name}; allowed: {', '.join(case_names())}, or a path to a YAML file"
        )
    if not is_name(path.stem):
        # Results are kept in a folder of this name.
        raise ConfigError(f"{key}: {path!s:.200}: its name cannot name a folder; allowed: rename the file")
    try:
        values = OmegaConf.to_container(read_yaml(path))
    except (YAMLError, OSError) as error:
        raise ConfigError(f"{path}: not readable as YAML: {' '.join(str(error).split())}") from None
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: must hold {', '.join(f.name for f in fields(CaseFile))}, not a list")
    for field in fields(CaseFile):
        if field.name in values and values[field.name] is None:
            wanted = "; [] stands for no ships" if field.name == "target_ships" else ""
            raise ConfigError(f"{path}: {field.name}: has no value{wanted}")
    ships = values.get("target_ships")
    # One by one first, because an error inside a list does not say in which entry it is.
    for index, ship in enumerate(ships if isinstance(ships, list) else ()):
        if isinstance(ship, dict):
            typed(TargetShip, ship, f"{path}: ", f"target_ships[{index}]")
    case = Case(**vars(typed(CaseFile, values, f"{path}: ")), name=path.stem)
    check_case(case, world, str(path))
    return case


def is_file(path: Path) -> bool:
    """Whether there is a file; a name that no file can have names none."""
    try:
        return path.is_file()
    except OSError:
        return False


def typed(schema: type, values: dict[Any, Any], where: str, key: str = "") -> Any:
    """Values as an object of the dataclass `schema`; a `ConfigError` begins with `where` and `key`."""
    check_shapes(schema, values, where, key)
    try:
        made: Any = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(schema), values))
    except OmegaConfBaseException as error:
        raise ConfigError(where + (f"{key}." if key else "") + explain(error)) from None
    except (RecursionError, OverflowError):
        raise ConfigError(
            f"{where}{key or 'case'}: an interpolation leads to itself, or to a number that is too large"
        ) from None
    # Once more, for an interpolation may lead to anything.
    check_shapes(schema, asdict(made), where, key)
    return made


def check_case(case: Case, world: World, where: str) -> None:
    """Raise a `ConfigError` naming file and field where a case cannot be sailed."""

    def need(condition: bool, what: str) -> None:
        if not condition:
            raise ConfigError(f"{where}: {what}")

    def number(value: float, name: str) -> None:
        # OmegaConf lets a list stand for a number inside a list; what is not a number fails every comparison.
        fits = isinstance(value, int | float) and abs(value) <= LARGEST
        need(fits, f"{name}: must be a number of at most {LARGEST:g} in size, got {value}")

    for name in ("start", "goal"):
        point = getattr(case, name)
        need(len(point) == 2, f"{name}: must be two numbers, got {point}")
        for index, value in enumerate(point):
            number(value, f"{name}[{index}]")
    number(case.heading, "heading")
    need(case.ideal_path.isprintable(), "ideal_path: must be one line of plain text")
    need(
        math.dist(case.start, case.goal) > world.goal_distance, "goal: must lie beyond the expected distance"
    )
    fastest = max(abs(speed) for speed, _ in world.actions)
    sailed, needed = (
        fastest * world.dt * world.max_steps,
        math.dist(case.start, case.goal) - world.goal_distance,
    )
    need(
        needed <= sailed or math.isclose(needed, sailed),
        f"goal: cannot be reached: {needed:.0f} m to the expected distance, and {world.max_steps} steps "
        f"(world.max_steps) of {world.dt:g} s at up to {fastest:g} m/s are {sailed:.0f} m",
    )
    ships = case.target_ships
    need(
        len(ships) <= MAX_TARGET_SHIPS,
        f"target_ships: at most {MAX_TARGET_SHIPS} are supported, got {len(ships)}",
    )
    for index, ship in enumerate(ships):
        for name, value in asdict(ship).items():
            number(value, f"target_ships[{index}].{name}")
        need(ship.speed >= 0, f"target_ships[{index}].speed: must be at least 0, got {ship.speed}")
        apart = math.dist(case.start, (ship.x, ship.y))
        need(
            apart >= world.safe_distance,
            f"target_ships[{index}]: must start at least the safe distance of "
            f"{world.safe_distance:g} m from own ship, got {apart:.1f} m",
        )
